// SPDX-License-Identifier: Apache-2.0
// What rays meet, and what lets them pass.
struct Hit {
  float t;
  float u;
  float v;
  uint instance;  // kNone: nothing
  uint triangle;  // among those of its tree
};

// Says whether a surface is not there.
bool is_absent(uint instance, uint number, float u, float v) {
  const uint material = material_of(instance, number);
  if ((world.materials.v[material].flags & kCutOut) == 0u) return false;
  const float opacity = opacity_at(material, uv_at(instance, number, u, v));
  const float threshold = world.materials.v[material].opacity_threshold;
  return threshold > 0.0 ? opacity < threshold : opacity <= 0.0;
}

// The share of light along a straight line through one surface; see attenuate_shadow_ray().
vec3 straight_share(uint instance, uint number, float u, float v, vec3 triangle_normal,
                    vec3 direction, bool passes_glass) {
  const uint material = material_of(instance, number);
  const uint flags = world.materials.v[material].flags;
  if ((flags & kDimsShadows) == 0u) return vec3(0.0);
  const vec2 uv = uv_at(instance, number, u, v);
  const float opacity = opacity_at(material, uv);
  const float threshold = world.materials.v[material].opacity_threshold;
  const float present =
      threshold > 0.0 ? (opacity < threshold ? 0.0 : 1.0) : clamp(opacity, 0.0, 1.0);
  vec3 share = vec3(1.0 - present);
  const bool is_thin = (flags & kThinWalled) != 0u;
  const float transmission = world.materials.v[material].transmission;
  if (present <= 0.0 || !(transmission > 0.0 && (passes_glass || is_thin))) return share;
  const float cosine = abs(dot(unit(triangle_normal), direction));
  const float once =
      fresnel_dielectric(max(1e-4, cosine), max(1.0001, world.materials.v[material].ior));
  const float reflected = is_thin ? 2.0 * once / (1.0 + once) : once;
  vec3 tint = world.materials.v[material].base_color;
  if (has_texture(material, kBaseColorSlot)) tint *= slot_at(material, kBaseColorSlot, uv, 0.0).xyz;
  if (!is_thin) tint = sqrt(max(tint, vec3(0.0)));
  const float weight = present * transmission * (1.0 - world.materials.v[material].metallic) *
                       (1.0 - reflected);
  return share + weight * tint;
}
