#version 460
// SPDX-License-Identifier: Apache-2.0
// Adds the light that arrives along the rays to lights, or to virtual ones.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"
#include "sampling.glsl"
#include "textures.glsl"
#include "surfaces.glsl"
#include "rays.glsl"

// RAY_QUERY: see intersect.comp.
#ifdef RAY_QUERY
#include "queries.glsl"

vec3 transmittance(vec3 origin, vec3 direction, float t_max, float time, bool passes_glass) {
  vec3 left = vec3(1.0);
  rayQueryEXT query;
  rayQueryInitializeEXT(query, accelerationStructureEXT(world.structure),
                        gl_RayFlagsTerminateOnFirstHitEXT, 0xFFu, origin, 0.0, direction, t_max);
  while (rayQueryProceedEXT(query)) {
    const Hit hit = HIT_OF(query, false);
    if ((world.instances.v[hit.instance].flags & kDims) != 0u) {
      Vec4s triangles = world.instances.v[hit.instance].triangles;
      const vec3 across =
          normal_in_world(hit.instance, cross(triangles.v[3u * hit.triangle + 1u].xyz,
                                              triangles.v[3u * hit.triangle + 2u].xyz));
      left *= straight_share(hit.instance, number_of(hit), hit.u, hit.v, across, direction,
                             passes_glass);
      if (largest(left) > 1e-4) continue;
    }
    rayQueryConfirmIntersectionEXT(query);
  }
  const bool is_blocked =
      rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
  return is_blocked ? vec3(0.0) : left;
}
#else
#include "trees.glsl"

vec3 transmittance(vec3 origin, vec3 direction, float t_max, float time, bool passes_glass) {
  const float t_min = 0.0;
  vec3 left = vec3(1.0);
  TRAVERSE(
      if ((flags & kDims) != 0u) {
        const vec3 across = turned_vector(
            instance, flags, normal_in_world(instance, cross(ab, ac)), time);
        left *= straight_share(instance, number, u, v, across, direction,
                               passes_glass);
        if (largest(left) > 1e-4) continue;
      }
      left = vec3(0.0);
      node = kEnd;
      break;)
  return left;
}
#endif

void main() {
  const uint count = connects != 0u ? job.counters.ready_connection_count
                                    : job.counters.ready_shadow_count;
  if (gl_GlobalInvocationID.x >= count) return;
  const uint ray = gl_GlobalInvocationID.x;
  Columns rays = job.shadows;
  if (connects != 0u) rays = job.connections;
  const vec4 from = rays.v[ray];
  const vec4 towards = rays.v[job.capacity + ray];
  const vec4 light = rays.v[2u * job.capacity + ray];
  const uint path = floatBitsToUint(towards.w) & 0x7FFFFFFFu;
  const bool is_indirect = floatBitsToUint(towards.w) >> 31 != 0u;
  const float time = STATE(kSampler, path).w;
  // It would bend the way between surfaces: paths find their own way through it.
  const bool passes_glass = job.has_caustics == 0u && connects == 0u;
  vec3 value = light.xyz * transmittance(from.xyz, towards.xyz, from.w, time, passes_glass);
  if (!(value.x + value.y + value.z < 1e20)) return;
  if (job.clamp_to > 0.0 && is_indirect) {
    const float l = luminance(value);
    if (l > job.clamp_to) value *= job.clamp_to / l;
  }
  if (value == vec3(0.0)) return;
  if (light.w != 0.0) {
    FINDING(path, 3u).xyz += value;
  } else {
    RESULT(1u, path).xyz += value;
  }
}
