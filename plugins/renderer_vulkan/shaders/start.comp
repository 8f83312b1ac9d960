#version 460
// SPDX-License-Identifier: Apache-2.0
// Begins the paths of a pass at the camera.
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"
#include "sampling.glsl"
#include "append.glsl"

bool start(uint path) {
  const SampleSlot slot = job.slots.v[gl_WorkGroupID.x];
  const uint column = gl_LocalInvocationIndex % 8u;
  const uint row = gl_LocalInvocationIndex / 8u;
  if (column >= slot.columns || row >= slot.rows) return false;
  const uint x = slot.x + column;
  const uint y = slot.y + row;
  // See SampleOrder; a block lies within one tile.
  const uint pixel = spread_bits(x & 1023u) | spread_bits(y & 1023u) << 1;
  const uint mask = (1u << job.sample_bits) - 1u;
  const uint order = pixel << job.sample_bits | (slot.sample_index & mask);
  Sampler random = Sampler(slot.key, 1u, bitfieldReverse(order));
  const vec2 u = next_pair(random);
  next_pair(random);  // of the aperture

  vec3 origin;
  vec3 direction;
  float t_min;
  float t_max;
  float time = 0.5;
  if (job.has_camera_rays != 0u) {
    const vec4 a = job.camera_rays.v[3u * path];
    const vec4 b = job.camera_rays.v[3u * path + 1u];
    const vec4 c = job.camera_rays.v[3u * path + 2u];
    origin = a.xyz;
    direction = b.xyz;
    t_min = a.w;
    t_max = b.w;
    time = c.x;
    random.dimension = floatBitsToUint(c.y);
    if (!(t_max > 0.0)) return false;
  } else {
    const vec2 within = job.starts_at_centres != 0u ? vec2(0.5) : u;
    const vec3 d = job.towards + (float(x) + within.x) * job.per_column +
                   (float(y) + within.y) * job.per_row;
    const float slant = sqrt(dot(d, d));
    origin = job.camera;
    direction = d * (1.0 / slant);
    t_min = job.near * slant;
    t_max = job.far * slant;
  }
  STATE(kOrigin, path) = vec4(origin, uintBitsToFloat(kIsCameraRay));
  STATE(kDirection, path) = vec4(direction, 0.0);
  STATE(kThroughput, path) = vec4(1.0);
  STATE(kLastPosition, path) = vec4(0.0);
  STATE(kLastNormal, path) = vec4(0.0, 0.0, 1.0, kInfinite);
  STATE(kFootprint, path) = vec4(0.0, job.pixel_angle, t_min, t_max);
  STATE(kSampler, path) = vec4(uintBitsToFloat(random.key), uintBitsToFloat(random.dimension),
                               uintBitsToFloat(random.place), time);
  return true;
}

void main() {
  const uint path = gl_GlobalInvocationID.x;
  // The others are read where a surface has been recorded.
  RESULT(0u, path) = vec4(0.0);
  RESULT(1u, path) = vec4(0.0);
  if (job.cache_use == kCacheLearns) {
    FINDING(path, 0u) = vec4(0.0);
    FINDING(path, 3u) = vec4(0.0);
  }
  const bool is_under_way = start(path);
  uint place;
  APPEND(job.counters.next_count, is_under_way, place)
  if (is_under_way) job.queues[queue].v[place] = path;
}
