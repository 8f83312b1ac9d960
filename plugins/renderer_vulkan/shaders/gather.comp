#version 460
// SPDX-License-Identifier: Apache-2.0
// Adds the results of a pass to the pixels, sample by sample: sums do not depend on how many
// samples a pass had. A group per block of pixels.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"
#include "sampling.glsl"

void main() {
  // Paths are still under way: they are gathered when all have ended.
  if (job.counters.path_count > 0u) return;
  const SlotRange range = job.ranges.v[gl_WorkGroupID.x];
  const SampleSlot slot = job.slots.v[range.first];
  const uint column = gl_LocalInvocationIndex % 8u;
  const uint row = gl_LocalInvocationIndex / 8u;
  if (column >= slot.columns || row >= slot.rows) return;
  const uint pixel = (slot.y + row) * job.width + slot.x + column;
  PixelSum sum = job.sums.v[pixel];
  for (uint k = 0u; k < range.count; ++k) {
    const uint path = (range.first + k) * kGroup + gl_LocalInvocationIndex;
    const vec4 seen = RESULT(0u, path);
    const vec4 scattered = RESULT(1u, path);
    ++sum.count;
    sum.seen += seen.xyz;
    sum.scattered += scattered.xyz;
    const float l = luminance(scattered.xyz);
    const float off = l - sum.mean;
    sum.mean += off / float(sum.count);
    sum.squares += off * (l - sum.mean);
    sum.brightest = max(sum.brightest, l);
    if (seen.w >= kChance) ++sum.chances;
    if (seen.w == 0.0 || seen.w == kChance) continue;
    const vec4 normal = RESULT(2u, path);
    const vec4 position = RESULT(3u, path);
    ++sum.surfaces;
    sum.albedo += vec3(scattered.w, normal.w, position.w);
    sum.normal += normal.xyz;
    sum.position += position.xyz;
  }
  job.sums.v[pixel] = sum;
}
