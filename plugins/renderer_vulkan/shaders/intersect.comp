#version 460
// SPDX-License-Identifier: Apache-2.0
// Finds what the rays of all paths under way meet first.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"
#include "sampling.glsl"
#include "textures.glsl"
#include "surfaces.glsl"
#include "rays.glsl"

// RAY_QUERY: by the device's own ray queries, for scenes where nothing moves.
#ifdef RAY_QUERY
#include "queries.glsl"

Hit closest(vec3 origin, vec3 direction, float t_min, float t_max, float time, uint left_instance,
            uint left_triangle) {
  const Hit nothing = Hit(kInfinite, 0.0, 0.0, kNone, 0u);
  // Of opaque triangles the device does not ask, unless one of them may be that which the ray left.
  const uint ray_flags = left_instance != kNone ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsNoneEXT;
  rayQueryEXT query;
  rayQueryInitializeEXT(query, accelerationStructureEXT(world.structure), ray_flags, 0xFFu, origin,
                        t_min, direction, t_max);
  while (rayQueryProceedEXT(query)) {
    const Hit hit = HIT_OF(query, false);
    if (hit.instance == left_instance && hit.triangle == left_triangle) continue;
    if ((world.instances.v[hit.instance].flags & kCutsOut) != 0u &&
        is_absent(hit.instance, number_of(hit), hit.u, hit.v)) {
      continue;
    }
    rayQueryConfirmIntersectionEXT(query);
  }
  if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) {
    return nothing;
  }
  return HIT_OF(query, true);
}
#else
#include "trees.glsl"

Hit closest(vec3 origin, vec3 direction, float t_min, float t_max, float time, uint left_instance,
            uint left_triangle) {
  Hit hit = Hit(kInfinite, 0.0, 0.0, kNone, 0u);
  TRAVERSE(
      if (instance == left_instance && triangle == left_triangle) continue;
      if ((flags & kCutsOut) != 0u && is_absent(instance, number, u, v)) continue;
      t_max = t;
      hit = Hit(t, u, v, instance, triangle);)
  return hit;
}
#endif

void main() {
  if (gl_GlobalInvocationID.x >= job.counters.path_count) return;
  const uint path = job.queues[queue].v[gl_GlobalInvocationID.x];
  const vec4 range = STATE(kFootprint, path);
  const vec4 origin = STATE(kOrigin, path);
  const bool leaves = (floatBitsToUint(origin.w) & kLeavesTriangle) != 0u;
  const Hit hit = closest(origin.xyz, STATE(kDirection, path).xyz, leaves ? 0.0 : range.z,
                          leaves ? kInfinite : range.w, STATE(kSampler, path).w,
                          leaves ? floatBitsToUint(range.z) : kNone,
                          leaves ? floatBitsToUint(range.w) : kNone);
  job.hits.v[path] = vec4(hit.t, hit.u, hit.v, uintBitsToFloat(hit.instance));
  job.hit_triangles.v[path] = hit.triangle;
}
