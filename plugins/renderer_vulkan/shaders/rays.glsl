// SPDX-License-Identifier: Apache-2.0
// Trees of boxes with four children each, over the instances and within meshes; see wide_tree.h. A
// child is a node, or a leaf: a part of an instance, or up to eight triangles in a row.
const uint kLeaf = 0x80000000u;
const uint kReturn = 0xFFFFFFFEu;  // from a mesh to the tree of the instances
const uint kEnd = 0xFFFFFFFFu;     // also: no child
// WideTree::kMostWaiting for each of two levels, and the way back between them.
const uint kStackSize = 144u;

struct Hit {
  float t;
  float u;
  float v;
  uint instance;  // kNone: nothing
  uint triangle;  // among those of its tree
};

vec3 inverse_of(vec3 d) {
  const float kLeast = 1e-20;
  return 1.0 / vec3(abs(d.x) < kLeast ? (d.x < 0.0 ? -kLeast : kLeast) : d.x,
                    abs(d.y) < kLeast ? (d.y < 0.0 ? -kLeast : kLeast) : d.y,
                    abs(d.z) < kLeast ? (d.z < 0.0 ? -kLeast : kLeast) : d.z);
}

vec4 bytes_of(uint word) {
  // Added to 2^23 as whole numbers: several times as fast as a conversion on most devices.
  const uvec4 bytes = uvec4(word, word >> 8, word >> 16, word >> 24) & 255u;
  return uintBitsToFloat(bytes | 0x4B000000u) - 8388608.0;
}

// Where a ray enters the boxes of a node's children; kInfinite: it does not.
vec4 entries_of(uvec4 head, uvec4 low_and_high, uvec2 rest_of_high, vec3 origin, vec3 inverse,
                float t_min, float t_max) {
  const vec3 size = uintBitsToFloat((uvec3(head.w, head.w >> 8, head.w >> 16) & 255u) << 23);
  const vec3 base = (uintBitsToFloat(head.xyz) - origin) * inverse;
  const vec3 per_step = size * inverse;
  const bvec3 is_back = lessThan(inverse, vec3(0.0));
  const uvec3 low = low_and_high.xyz;
  const uvec3 high = uvec3(low_and_high.w, rest_of_high);
  const uvec3 near = mix(low, high, is_back);
  const uvec3 far = mix(high, low, is_back);
  const vec4 enters = max(max(bytes_of(near.x) * per_step.x + base.x,
                              bytes_of(near.y) * per_step.y + base.y),
                          max(bytes_of(near.z) * per_step.z + base.z, vec4(t_min)));
  const vec4 leaves = min(min(bytes_of(far.x) * per_step.x + base.x,
                              bytes_of(far.y) * per_step.y + base.y),
                          min(bytes_of(far.z) * per_step.z + base.z, vec4(t_max)));
  return mix(vec4(kInfinite), enters, lessThanEqual(enters, leaves * 1.000001));
}

#define IN_ORDER(t, children, I, J)                  \
  if (t[J] < t[I]) {                                 \
    t = vec4(t).SWAP_##I##J;                         \
    children = uvec4(children).SWAP_##I##J;          \
  }
#define SWAP_01 yxzw
#define SWAP_23 xywz
#define SWAP_02 zyxw
#define SWAP_13 xwzy
#define SWAP_12 xzyw

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

#define TRAVERSE(ON_HIT)                                                                          \
  uint stack[kStackSize];                                                                         \
  uint top = 0u;                                                                                  \
  Uvec4s nodes = world.tree;                                                                       \
  uint instance = kNone;                                                                          \
  uint flags = 0u;                                                                                \
  vec3 o = origin;                                                                                \
  vec3 d = direction;                                                                             \
  vec3 inverse = inverse_of(d);                                                                   \
  uint node = world.instance_count > 0u ? 0u : kEnd;                                              \
  const uint limit = job.iteration_limit;                                                         \
  uint iterations = 0u;                                                                           \
  while (node != kEnd) {                                                                          \
    while (node < kLeaf && iterations <= limit) {                                                 \
      ++iterations;                                                                               \
      const uvec4 head = nodes.v[4u * node];                                                      \
      uvec4 children = nodes.v[4u * node + 1u];                                                   \
      vec4 t = entries_of(head, nodes.v[4u * node + 2u], nodes.v[4u * node + 3u].xy, o, inverse,  \
                          t_min, t_max);                                                          \
      t = mix(t, vec4(kInfinite), equal(children, uvec4(kEnd)));                                  \
      IN_ORDER(t, children, 0, 1)                                                                 \
      IN_ORDER(t, children, 2, 3)                                                                 \
      IN_ORDER(t, children, 0, 2)                                                                 \
      IN_ORDER(t, children, 1, 3)                                                                 \
      IN_ORDER(t, children, 1, 2)                                                                 \
      if (t.w < kInfinite) stack[top++] = children.w;                                             \
      if (t.z < kInfinite) stack[top++] = children.z;                                             \
      if (t.y < kInfinite) stack[top++] = children.y;                                             \
      if (t.x < kInfinite) {                                                                      \
        node = children.x;                                                                        \
      } else {                                                                                    \
        node = top > 0u ? stack[--top] : kEnd;                                                    \
      }                                                                                           \
    }                                                                                             \
    if (++iterations > limit) {                                                                   \
      job.counters.is_over_limit = 1u;                                                            \
      break;                                                                                      \
    }                                                                                             \
    if (node == kReturn) {                                                                        \
      nodes = world.tree;                                                                         \
      instance = kNone;                                                                           \
      o = origin;                                                                                 \
      d = direction;                                                                              \
      inverse = inverse_of(d);                                                                    \
      node = top > 0u ? stack[--top] : kEnd;                                                      \
    } else if (node == kEnd) {                                                                    \
      break;                                                                                      \
    } else if (instance == kNone) {                                                               \
      const uint reference = 2u * (node & 0x7FFFFFFFu);                                           \
      instance = world.references.v[reference];                                                   \
      flags = world.instances.v[instance].flags;                                                  \
      nodes = world.instances.v[instance].nodes;                                                  \
      vec3 from = origin;                                                                         \
      vec3 towards = direction;                                                                   \
      if ((flags & kMoves) != 0u) {                                                               \
        const mat3 turn = turn_of(instance, time);                                                \
        const vec3 centre = world.instances.v[instance].centre;                                   \
        const float seconds = (time - 0.5) * world.window;                                        \
        from = (from - centre - world.instances.v[instance].linear * seconds) * turn + centre;    \
        towards = towards * turn;                                                                 \
      }                                                                                           \
      const vec4 r0 = world.instances.v[instance].node_from_world[0];                             \
      const vec4 r1 = world.instances.v[instance].node_from_world[1];                             \
      const vec4 r2 = world.instances.v[instance].node_from_world[2];                             \
      o = vec3(dot(r0, vec4(from, 1.0)), dot(r1, vec4(from, 1.0)), dot(r2, vec4(from, 1.0)));     \
      d = vec3(dot(r0.xyz, towards), dot(r1.xyz, towards), dot(r2.xyz, towards));                 \
      inverse = inverse_of(d);                                                                    \
      stack[top++] = kReturn;                                                                     \
      node = world.references.v[reference + 1u];                                                  \
    } else {                                                                                      \
      const uint first = (node & 0x7FFFFFFFu) >> 3;                                               \
      const uint end = first + (node & 7u) + 1u;                                                  \
      Vec4s triangles = world.instances.v[instance].triangles;                                    \
      for (uint triangle = first; triangle < end; ++triangle) {                                   \
        const vec4 corner = triangles.v[3u * triangle];                                           \
        const vec3 ab = triangles.v[3u * triangle + 1u].xyz;                                      \
        const vec3 ac = triangles.v[3u * triangle + 2u].xyz;                                      \
        const vec3 p = cross(d, ac);                                                              \
        const float det = dot(ab, p);                                                             \
        if (det == 0.0) continue;                                                                 \
        const float scale = 1.0 / det;                                                            \
        const vec3 s = o - corner.xyz;                                                            \
        const float u = dot(s, p) * scale;                                                        \
        const vec3 q = cross(s, ab);                                                              \
        const float v = dot(d, q) * scale;                                                        \
        const float t = dot(ac, q) * scale;                                                       \
        if (!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > t_min && t <= t_max)) continue;         \
        const uint number = floatBitsToUint(corner.w);                                            \
        ON_HIT                                                                                    \
      }                                                                                           \
      iterations += end - first;                                                                  \
      if (node != kEnd) node = top > 0u ? stack[--top] : kEnd;                                    \
    }                                                                                             \
  }
