#version 460
// SPDX-License-Identifier: Apache-2.0
// What becomes of paths where they met something; see path_tracer.cpp of embree_support.
// VIRTUAL_LIGHTS: surfaces are connected with virtual lights. That takes as much code again as the
// lights have, which other pictures' paths need not wait for.
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"
#include "sampling.glsl"
#include "textures.glsl"
#include "surfaces.glsl"
#include "bsdf.glsl"
#include "lights.glsl"
#include "radiance_cache.glsl"
#include "append.glsl"

const uint kMostStraightPasses = 64u;

struct Path {
  vec3 origin;
  vec3 direction;
  vec3 throughput;
  float left_by_first;
  float light_share;  // what light found from the last vertex counts for beside virtual lights
  uint flags;
  int bounce;
  uint passes;
  Receiver last;
  float last_density;
  float since_last;
  float width;
  float spread;
  Sampler random;
  float time;  // share of the shutter's window
  uint left_instance;  // with kLeavesTriangle
  uint left_triangle;
  // What is added to its result.
  vec3 seen;
  vec3 scattered;
  bool finds;  // which belongs to its finding, begun at an earlier surface
  bool records;
  vec3 albedo;
  vec3 normal;
  vec3 position;
};

struct ShadowRay {
  bool is_wanted;
  vec3 origin;
  vec3 direction;
  float reach;
  vec3 light;
  bool is_indirect;
  bool is_finding;  // belongs to the path's finding
};

struct SurfacePoint {
  vec3 position;
  vec3 flat_normal;
  vec3 normal;
  vec2 uv;
  float uv_per_metre;
  bool is_back;
  float met_after;  // by the ray
  uint instance;
  uint triangle;  // among those of its tree
  uint number;    // among those of the mesh
  vec2 at;        // on it
};

bool has(Path path, uint flag) { return (path.flags & flag) != 0u; }
bool is_soft(Path path) { return has(path, kHasScattered) && job.has_caustics == 0u; }
void choose(inout Path path) {
  if (!has(path, kHasSurface)) path.flags |= kByChance;
}
bool is_first(Path path) { return path.last_density >= kInfinite; }

Path load_path(uint index) {
  Path path;
  const vec4 s0 = STATE(kOrigin, index);
  const vec4 s1 = STATE(kDirection, index);
  const vec4 s2 = STATE(kThroughput, index);
  const vec4 s3 = STATE(kLastPosition, index);
  const vec4 s4 = STATE(kLastNormal, index);
  const vec4 s5 = STATE(kFootprint, index);
  const vec4 s6 = STATE(kSampler, index);
  path.origin = s0.xyz;
  path.flags = floatBitsToUint(s0.w);
  path.bounce = int(path.flags & 255u);
  path.passes = path.flags >> 8 & 255u;
  path.direction = s1.xyz;
  path.since_last = s1.w;
  path.throughput = s2.xyz;
  path.left_by_first = s2.w;
  path.last = Receiver(s3.xyz, s4.xyz, has(path, kLastTwoSided), s3.w);
  path.last_density = s4.w;
  path.width = s5.x;
  path.spread = s5.y;
  path.random =
      Sampler(floatBitsToUint(s6.x), floatBitsToUint(s6.y), floatBitsToUint(s6.z));
  path.time = s6.w;
  path.flags &= ~kLeavesTriangle;
  path.light_share = 1.0;
#ifdef VIRTUAL_LIGHTS
  if (has(path, kHasShare)) path.light_share = STATE(kBeside, index).x;
#endif
  path.seen = vec3(0.0);
  path.scattered = vec3(0.0);
  path.finds = has(path, kHasFinding);
  path.records = false;
  return path;
}

void store_path(uint index, Path path) {
  const bool leaves = has(path, kLeavesTriangle);
  uint flags = path.flags & (kIsCameraRay | kHasScattered | kHidesLights | kHasSurface |
                             kLeavesTriangle | kByChance | kHasFinding | kIsConnected);
  flags |= uint(path.bounce) | path.passes << 8;
#ifdef VIRTUAL_LIGHTS
  if (path.light_share != 1.0) {
    flags |= kHasShare;
    STATE(kBeside, index) = vec4(path.light_share, 0.0, 0.0, 0.0);
  }
#endif
  if (path.last.is_two_sided) flags |= kLastTwoSided;
  STATE(kOrigin, index) = vec4(path.origin, uintBitsToFloat(flags));
  STATE(kDirection, index) = vec4(path.direction, path.since_last);
  STATE(kThroughput, index) = vec4(path.throughput, path.left_by_first);
  STATE(kLastPosition, index) = vec4(path.last.position, path.last.total_score);
  STATE(kLastNormal, index) = vec4(path.last.normal, path.last_density);
  STATE(kFootprint, index) =
      vec4(path.width, path.spread, leaves ? uintBitsToFloat(path.left_instance) : 0.0,
           leaves ? uintBitsToFloat(path.left_triangle) : kInfinite);
  STATE(kSampler, index) =
      vec4(uintBitsToFloat(path.random.key), uintBitsToFloat(path.random.dimension),
           uintBitsToFloat(path.random.place), path.time);
}

void store_result(uint index, Path path, bool goes_on) {
  if (path.seen != vec3(0.0)) RESULT(0u, index).xyz += path.seen;
  if (path.scattered != vec3(0.0)) {
    if (path.finds) {
      FINDING(index, 3u).xyz += path.scattered;
    } else {
      RESULT(1u, index).xyz += path.scattered;
    }
  }
  const bool ends_without = !goes_on && !has(path, kHasSurface);
  if (!path.records && !ends_without) return;
  RESULT(0u, index).w = (path.records ? kSurface : 0.0) + (has(path, kByChance) ? kChance : 0.0);
  if (!path.records) return;
  RESULT(1u, index).w = path.albedo.x;
  RESULT(2u, index) = vec4(path.normal, path.albedo.y);
  RESULT(3u, index) = vec4(path.position, path.albedo.z);
}

void add(inout Path path, vec3 radiance) {
  if (!(radiance.x + radiance.y + radiance.z < 1e20)) return;
  if (!has(path, kHasScattered)) {
    path.seen += radiance;
    return;
  }
  if (job.clamp_to > 0.0 && path.bounce > 1) {
    const float l = luminance(radiance);
    if (l > job.clamp_to) radiance *= job.clamp_to / l;
  }
  path.scattered += radiance;
}

void collect_light(inout Path path, uint light, vec3 from, float t_min, float t_max) {
  if (has(path, kIsCameraRay) && (world.lights.v[light].flags & kLightVisible) == 0u) return;
  vec3 radiance;
  const float density = intersect_light(light, from, path.direction, t_min, t_max, radiance);
  if (!(density > 0.0)) return;
  float weight = 1.0;
  if (!is_first(path)) {
    weight = mis_weight(path.last_density, choice_probability(light, path.last) * density);
  }
  add(path, path.throughput * radiance * (weight * path.light_share));
}

// From the surface that took the light sample, which may lie behind panes.
void collect_lights(inout Path path, float distance) {
  if (has(path, kHidesLights)) return;
  const float passed = path.since_last;
  const vec3 from = path.origin - passed * path.direction;
  const bool is_open = distance >= kInfinite;
  const float end = is_open ? kInfinite : passed + distance;
  const uint count = world.shape_count + (is_open ? world.surroundings_count : 0u);
  [[dont_unroll]] for (uint k = 0u; k < count; ++k) {
    const bool is_shape = k < world.shape_count;
    const uint light =
        is_shape ? world.light_shapes.v[k] : world.surroundings.v[k - world.shape_count];
    if (is_shape && !is_near(light, from, path.direction)) continue;
    collect_light(path, light, from, passed, end);
  }
}

void collect_emission(inout Path path, uint instance, uint number, uint instance_flags,
                      uint material, SurfacePoint surface) {
  if (has(path, kHidesLights)) return;
  if (surface.is_back && (instance_flags & kDoubleSided) == 0u) return;
  const vec3 radiance = emission_at(material, surface.uv, path.width * surface.uv_per_metre);
  float weight = 1.0;
  const uint light = (instance_flags & kHasLights) != 0u
                         ? world.instances.v[instance].triangle_lights.v[number]
                         : kNone;
  if (!is_first(path) && light != kNone) {
    const float cosine = max(1e-6, abs(dot(surface.flat_normal, path.direction)));
    const float density =
        path.since_last * path.since_last / (cosine * world.lights.v[light].area);
    weight = mis_weight(path.last_density, choice_probability(light, path.last) * density);
  }
  if (light != kNone) weight *= path.light_share;
  add(path, path.throughput * radiance * weight);
}

vec3 mapped_normal(uint instance, uint number, uint triangle, vec3 local, SurfacePoint s,
                   vec3 to_viewer, float time) {
  const uint flags = world.instances.v[instance].flags;
  if ((flags & kHasUvs) == 0u) return s.normal;
  const CornerUvs uvs = corner_uvs(instance, number);
  const vec2 e = uvs.b - uvs.a;
  const vec2 f = uvs.c - uvs.a;
  const float det = e.x * f.y - e.y * f.x;
  if (det == 0.0) return s.normal;
  Vec4s triangles = world.instances.v[instance].triangles;
  const vec3 ab = linear_part(instance, triangles.v[3u * triangle + 1u].xyz);
  const vec3 ac = linear_part(instance, triangles.v[3u * triangle + 2u].xyz);
  const vec3 along_u = turned_vector(instance, flags, (ab * f.y - ac * e.y) / det, time);
  const vec3 along_v = turned_vector(instance, flags, (ac * e.x - ab * f.x) / det, time);
  const vec3 within = along_u - s.normal * dot(s.normal, along_u);
  const float length2 = dot(within, within);
  if (!(length2 > 0.0)) return s.normal;
  const vec3 tangent = within / sqrt(length2);
  vec3 bitangent = cross(s.normal, tangent);
  if (dot(bitangent, along_v) < 0.0) bitangent = -bitangent;
  vec3 n = local.x * tangent + local.y * bitangent + max(0.05, local.z) * s.normal;
  const float n2 = dot(n, n);
  if (!(n2 >= 1e-8 && n2 < 1e30)) return s.normal;
  n = n / sqrt(n2);
  const float kHorizon = 0.05;
  const float facing = dot(n, to_viewer);
  if (facing < kHorizon) n = unit(n + (kHorizon - facing) * to_viewer);
  return n;
}

float alpha_of(float roughness, bool softens) {
  const float kSoftAlpha = 0.15;
  const float r = clamp(roughness, 0.0, 1.0);
  return max(softens ? kSoftAlpha : kMinAlpha, r * r);
}

// Straight on, or mirrored: true if the path goes on, without scattering. Else the surface scatters.
const uint kScattered = 0u;
const uint kGoesOn = 1u;
const uint kEnds = 2u;

// Where a path begins that goes on through the surface; see go_through() of embree_support.
vec3 go_through(inout Path path, SurfacePoint s, vec3 towards, out float back) {
  const float cosine = max(0.1, abs(dot(towards, s.flat_normal)));
  const float reach = step_length(s.position) / cosine;
  back = 0.0;
  if (s.met_after < reach) return leave(s.position, s.flat_normal, towards);
  path.flags |= kLeavesTriangle;
  path.left_instance = s.instance;
  path.left_triangle = s.triangle;
  back = 0.25 * reach;
  return s.position - back * towards;
}

void pass(inout Path path, SurfacePoint s, out uint what) {
  what = ++path.passes <= kMostStraightPasses ? kGoesOn : kEnds;
  float back;
  path.origin = go_through(path, s, path.direction, back);
  path.since_last -= back;
}

uint pass_or_reflect(inout Path path, uint material, uint material_flags, SurfacePoint s,
                     inout Surface surface) {
  uint what = kScattered;
  const vec2 u = next_pair(path.random);
  float rest = u.x;
  if ((material_flags & kBlended) != 0u) {
    const float gap = 1.0 - clamp(opacity_at(material, s.uv), 0.0, 1.0);
    if (gap > 0.0) choose(path);
    if (rest < gap) {
      pass(path, s, what);
      return what;
    }
    rest = (rest - gap) / (1.0 - gap);
  }
  if ((material_flags & kThinGlass) == 0u) return kScattered;
  const float share = (1.0 - surface.metallic) * surface.transmission;
  if (share > 0.0) choose(path);
  if (rest >= share) {
    surface.metallic = share < 1.0 ? surface.metallic / (1.0 - share) : 0.0;
    surface.transmission = 0.0;
    return kScattered;
  }
  const float cosine = max(1e-4, -dot(s.normal, path.direction));
  const float once = fresnel_dielectric(cosine, max(1.0001, world.materials.v[material].ior));
  const float reflected = 2.0 * once / (1.0 + once);
  const bool is_first_seen =
      !has(path, kHasScattered) && path.passes == 0u && path.bounce == 0;
  const float chance = is_first_seen ? clamp(reflected, 0.25, 0.75) : reflected;
  if (u.y >= chance) {
    path.throughput *= surface.base * ((1.0 - reflected) / (1.0 - chance));
    pass(path, s, what);
    return what;
  }
  path.throughput *= reflected / chance;
  const vec3 reflection = path.direction + 2.0 * cosine * s.normal;
  path.last_density = kInfinite;
  path.light_share = 1.0;
  path.flags &= ~(kHidesLights | kIsCameraRay | kIsConnected);
  if (is_soft(path)) path.flags |= kHidesLights;
  path.since_last = 0.0;
  ++path.bounce;
  path.origin = leave(s.position, s.flat_normal, reflection);
  path.direction = unit(reflection);
  return dot(s.flat_normal, reflection) > 0.0 ? kGoesOn : kEnds;
}

// True: along a new ray.
bool go_on(inout Path path, vec3 weight, float density, float spread, float roulette, vec3 origin,
           vec3 direction) {
  if (!(largest(weight) > 0.0)) return false;
  path.throughput *= weight;
  const float left = largest(path.throughput);
  if (path.bounce == 0) path.left_by_first = left;
  const float first = has(path, kHasSurface) ? job.indirect_share : 1.0;
  const float survival =
      path.bounce == 0 ? first : min(0.95, job.continuation * left / path.left_by_first);
  if (survival < 1.0) {
    if (roulette >= survival) return false;
    path.throughput *= 1.0 / survival;
  }
  ++path.bounce;
  path.last_density = density;
  path.since_last = 0.0;
  path.spread = max(path.spread, min(spread, job.most_spread));
  path.origin = origin;
  path.direction = direction;
  return true;
}

void record(inout Path path, SurfacePoint s, vec3 share) {
  path.flags |= kHasSurface;
  path.records = true;
  path.albedo = path.throughput * share;
  path.normal = s.normal;
  path.position = s.position;
}

float weight_of_light(float found, float probability, bool is_rival, float rival) {
  const bool is_point = found >= kInfinite;
  const float density = (is_point ? 1.0 : found) * probability;
  return (is_rival && !is_point ? mis_weight(density, rival) : 1.0) / density;
}

void want_light(Path path, vec3 share, vec3 radiance, SurfacePoint s, LightSample light,
                inout ShadowRay shadow) {
  const float reach =
      light.distance >= kInfinite ? kInfinite : max(0.0, light.distance * 0.9998 - 1e-4);
  if (!(reach > 0.0) || !(largest(share) > 0.0)) return;
  shadow.is_wanted = true;
  shadow.origin = leave(s.position, s.flat_normal, light.direction);
  shadow.direction = light.direction;
  shadow.reach = reach;
  shadow.light = path.light_share * path.throughput * share * radiance;
  shadow.is_indirect = path.bounce > 1;
  // The light sample where the finding begins is the path's own.
  shadow.is_finding = path.finds;
}

// Whether the path ends here with light from the cache.
bool ends_in_cache(inout Path path, uint index, SurfacePoint s, vec3 weight) {
  if (job.cache_use == kCacheLearns) {
    path.flags |= kHasFinding;
    FINDING(index, 0u) = vec4(s.position, 1.0);
    FINDING(index, 1u) = vec4(s.normal, path.since_last);
    FINDING(index, 2u) = vec4(weight, path.bounce > 1 ? job.clamp_to : 0.0);
    return false;
  }
  vec3 light;
  if (!find_cached(s.position, s.normal, path.since_last, light)) return false;
  add(path, weight * light);
  return true;
}

#ifdef VIRTUAL_LIGHTS
#include "virtual_lights.glsl"
#endif

// True: the path goes on.
bool scatter(inout Path path, uint index, SurfacePoint s, Surface surface, inout ShadowRay shadow,
             inout ShadowRay connection) {
  const bool was_soft = is_soft(path);
  Bsdf bsdf = finished(surface, s.is_back);
  const mat3 basis = basis_around(s.normal);
  vec3 wo = to_local(basis, -path.direction);
  wo.z = max(wo.z, 1e-4);
  see_from(bsdf, unit(wo));
  const bool has_glass = bsdf.glass > 0.0;

  const vec2 u0 = next_pair(path.random);  // light, roulette
  const vec2 u1 = next_pair(path.random);  // place on the light
  const vec2 u2 = next_pair(path.random);  // lobe
  const vec2 u3 = next_pair(path.random);  // direction
  Receiver receiver = Receiver(s.position, s.normal, !was_soft && has_glass, 0.0);
  float probability = 0.0;
  LightSample light = LightSample(vec3(0.0, 0.0, 1.0), 0.0, 0.0, vec3(0.0));
  if (world.light_count > 0u) {
    const uint chosen = choose_light(receiver, u0.x, probability);
    if (probability > 0.0) light = sample_light(chosen, s.position, u1);
  }
  const bool is_last = path.bounce == job.max_bounces && is_rough(bsdf);
  bool ends = false;  // in the cache
  const vec3 to_light = to_local(basis, light.direction);

  if (has_glass) {
    path.light_share = 1.0;
    path.flags &= ~kIsConnected;
    if (has_smooth_part(bsdf)) {
      if (!has(path, kHasSurface)) record(path, s, albedo(bsdf));
      path.flags = (path.flags & ~kIsCameraRay) | kHasScattered;
      path.last = receiver;
      const bool is_behind = to_light.z <= 0.0;
      if (light.density > 0.0 && (!is_behind || receiver.is_two_sided) &&
          (dot(s.flat_normal, light.direction) <= 0.0) == is_behind) {
        const vec4 value = evaluate_bsdf(bsdf, to_light);
        const vec3 share = value.xyz * weight_of_light(light.density, probability, true, value.w);
        want_light(path, share, light.radiance, s, light, shadow);
      }
    }
    path.flags &= ~kIsCameraRay;
    choose(path);
    const BsdfSample next = sample_bsdf(bsdf, u2.x, u3);
    const vec3 direction = to_world(basis, next.wi);
    if ((dot(s.flat_normal, direction) <= 0.0) != next.is_transmitted) return false;
    const bool hides = is_soft(path) && (next.density >= kInfinite || (next.is_transmitted && was_soft));
    path.flags = hides ? path.flags | kHidesLights : path.flags & ~kHidesLights;
    vec3 origin;
    if (next.is_transmitted) {
      float back;
      origin = go_through(path, s, direction, back);
    } else {
      origin = leave(s.position, s.flat_normal, direction);
    }
    return go_on(path, next.weight, next.density, next.spread, u0.y, origin, direction);
  }

  const bool is_first_surface = !has(path, kHasSurface);
  if (is_first_surface && !is_mirror(bsdf)) record(path, s, albedo(bsdf));
  if (job.cache_use != 0u && !is_first_surface && !is_last && !has(path, kHasFinding) &&
      is_rough(bsdf)) {
    ends = ends_in_cache(path, index, s, path.throughput * albedo(bsdf));
  }
  path.flags = (path.flags & ~(kIsCameraRay | kHidesLights)) | kHasScattered;
  path.last = receiver;
#ifdef VIRTUAL_LIGHTS
  path.light_share = has(path, kIsConnected) ? share_beside_virtual_lights(path, s) : 1.0;
  path.flags &= ~kIsConnected;
  if (!ends && !is_mirror(bsdf) && path.bounce < job.max_bounces) {
    path.flags |= kIsConnected;
    connect(path, s, bsdf, basis, u2.y, connection);
  }
#endif
  if (light.density > 0.0 && to_light.z > 0.0 && dot(s.flat_normal, light.direction) > 0.0) {
    const vec4 value = evaluate_lobes(bsdf, to_light);
    const vec3 share = value.xyz * weight_of_light(light.density, probability, !is_last, value.w);
    want_light(path, share, light.radiance, s, light, shadow);
  }
  if (is_last || ends) return false;
  float spread;
  const vec3 wi = sample_lobes(bsdf, u2.x, u3, spread);
  if (!(wi.z > 0.0)) return false;
  const vec3 direction = to_world(basis, wi);
  const vec4 value = evaluate_lobes(bsdf, wi);
  if (!(value.w > kLeastDensity) || !(dot(s.flat_normal, direction) > 0.0)) return false;
  return go_on(path, value.xyz * (1.0 / value.w), value.w, spread, u0.y,
               leave(s.position, s.flat_normal, direction), direction);
}

SurfacePoint surface_of(Path path, vec4 hit, uint instance, uint flags, uint number, uint triangle,
                        vec3 triangle_normal) {
  SurfacePoint s;
  s.position = path.origin + hit.x * path.direction;
  s.met_after = hit.x;
  s.instance = instance;
  s.triangle = triangle;
  s.number = number;
  s.at = hit.yz;
  const float area2 = dot(triangle_normal, triangle_normal);
  const vec3 flat_normal = area2 > 0.0 ? triangle_normal * (1.0 / sqrt(area2)) : -path.direction;
  const float facing = dot(flat_normal, path.direction);
  s.is_back = (facing > 0.0) != ((flags & kMirrored) != 0u);
  s.flat_normal = facing > 0.0 ? -flat_normal : flat_normal;
  vec3 normal = s.flat_normal;
  if ((flags & kHasNormals) != 0u) {
    const vec3 n = node_normal(instance, number, hit.y, hit.z);
    vec3 interpolated = vec3(dot(world.instances.v[instance].normal_from_node[0], n),
                             dot(world.instances.v[instance].normal_from_node[1], n),
                             dot(world.instances.v[instance].normal_from_node[2], n));
    interpolated = turned_vector(instance, flags, interpolated, path.time);
    const float length2 = dot(interpolated, interpolated);
    if (length2 > 0.0) normal = interpolated * ((s.is_back ? -1.0 : 1.0) / sqrt(length2));
  }
  // Seen from the visible side, a normal that points away is bent back to the horizon.
  const float away = max(0.0, dot(normal, path.direction) + 1e-4);
  s.normal = unit(normal - away * path.direction);
  s.uv = vec2(0.0);
  s.uv_per_metre = 0.0;
  return s;
}

// True: the path goes on.
bool advance(inout Path path, uint index, inout ShadowRay shadow, inout ShadowRay connection) {
  const vec4 hit = job.hits.v[index];
  const uint instance = floatBitsToUint(hit.w);
  collect_lights(path, instance == kNone ? kInfinite : hit.x);
  if (instance == kNone) return false;
  path.since_last += hit.x;
  path.width += path.spread * hit.x;

  const uint triangle = job.hit_triangles.v[index];
  Vec4s triangles = world.instances.v[instance].triangles;
  const uint number = floatBitsToUint(triangles.v[3u * triangle].w);
  const uint flags = world.instances.v[instance].flags;
  const uint material = material_of(instance, number);
  const uint material_flags = world.materials.v[material].flags;
  if (path.bounce > job.max_bounces && (material_flags & kEmits) == 0u) return false;

  const vec3 triangle_normal =
      turned_vector(instance, flags,
                    normal_in_world(instance, cross(triangles.v[3u * triangle + 1u].xyz,
                                                    triangles.v[3u * triangle + 2u].xyz)),
                    path.time);
  SurfacePoint s = surface_of(path, hit, instance, flags, number, triangle, triangle_normal);
  const bool was_soft = is_soft(path);
  Surface surface = world.materials.v[material].surfaces[was_soft ? 1 : 0];
  const bool has_colors = (flags & kHasColors) != 0u;
  if ((material_flags & kSpecial) != 0u || has_colors) {
    if ((material_flags & kReadsUv) != 0u && (flags & kHasUvs) != 0u) {
      const CornerUvs uvs = corner_uvs(instance, number);
      const vec2 e = uvs.b - uvs.a;
      const vec2 f = uvs.c - uvs.a;
      s.uv = uvs.a + hit.y * e + hit.z * f;
      const float twice_area = sqrt(dot(triangle_normal, triangle_normal));
      s.uv_per_metre = twice_area > 0.0 ? sqrt(abs(e.x * f.y - e.y * f.x) / twice_area) : 0.0;
    }
    if ((material_flags & kEmits) != 0u) {
      collect_emission(path, instance, number, flags, material, s);
    }
    if (path.bounce > job.max_bounces) return false;
    if ((material_flags & kTextured) != 0u || has_colors) {
      const float cosine = max(0.1, -dot(s.normal, path.direction));
      const float footprint = path.width * s.uv_per_metre / sqrt(cosine);
      vec3 color = world.materials.v[material].base_color;
      vec3 local_normal = vec3(0.0, 0.0, 1.0);
      // One lookup for all slots, and one scatter() for all surfaces: code that does not fit caches
      // took longer than all that it did.
      [[dont_unroll]] for (uint slot = kBaseColorSlot; slot <= kNormalSlot; ++slot) {
        if (!has_texture(material, slot)) continue;
        const vec4 value = slot_at(material, slot, s.uv, footprint);
        if (slot == kBaseColorSlot) {
          color *= value.xyz;
        } else if (slot == kNormalSlot) {
          local_normal = value.xyz;
        } else {
          const float scalar = value[world.materials.v[material].slots[slot].channel];
          if (slot == kMetallicSlot) {
            surface.metallic = clamp(scalar, 0.0, 1.0);
          } else {
            surface.alpha = alpha_of(scalar, was_soft && surface.has_glass == 0u);
          }
        }
      }
      if (has_colors) color *= color_at(instance, number, hit.y, hit.z);
      surface.base = clamp(color, vec3(0.0), vec3(1.0));
      if (has_texture(material, kNormalSlot)) {
        s.normal = mapped_normal(instance, number, triangle, local_normal, s, -path.direction,
                                 path.time);
      }
    }
    if ((material_flags & (kThinGlass | kBlended)) != 0u) {
      const uint what = pass_or_reflect(path, material, material_flags, s, surface);
      if (what != kScattered) return what == kGoesOn;
    }
  }
  return scatter(path, index, s, surface, shadow, connection);
}

#define STORE_RAY(RAYS, RAY)                                                           \
  if (RAY.is_wanted) {                                                                \
    RAYS.v[place] = vec4(RAY.origin, RAY.reach);                                      \
    RAYS.v[job.capacity + place] = vec4(                                              \
        RAY.direction, uintBitsToFloat(index | (RAY.is_indirect ? 0x80000000u : 0u))); \
    RAYS.v[2u * job.capacity + place] = vec4(RAY.light, RAY.is_finding ? 1.0 : 0.0);  \
  }

void main() {
  const bool is_under_way = gl_GlobalInvocationID.x < job.counters.path_count;
  uint index = 0u;
  bool goes_on = false;
  ShadowRay shadow = ShadowRay(false, vec3(0.0), vec3(0.0), 0.0, vec3(0.0), false, false);
  ShadowRay connection = shadow;
  if (is_under_way) {
    index = job.queues[queue].v[gl_GlobalInvocationID.x];
    Path path = load_path(index);
    goes_on = advance(path, index, shadow, connection);
    store_result(index, path, goes_on);
    if (goes_on) store_path(index, path);
  }
  uint place;
  APPEND(job.counters.next_count, goes_on, place)
  if (goes_on) job.queues[1u - queue].v[place] = index;
  APPEND(job.counters.shadow_count, shadow.is_wanted, place)
  STORE_RAY(job.shadows, shadow)
#ifdef VIRTUAL_LIGHTS
  APPEND(job.counters.connection_count, connection.is_wanted, place)
  STORE_RAY(job.connections, connection)
#endif
}
