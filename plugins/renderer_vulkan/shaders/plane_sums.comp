#version 460
// SPDX-License-Identifier: Apache-2.0
// Light of blocks of pixels: without a reach as it was sampled, else as it was filtered. A group per
// block.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"
#include "block_sum.glsl"

vec4 value_of(uint pixel) {
  const vec4 light = LIGHT(from, pixel);
  return vec4(reach == 0u ? support.v[pixel] : light.w, 0.0, 0.0, 0.0);
}

void main() {
  const uint kind = reach == 0u ? kBefore : kAfter;
  for (uint block = gl_WorkGroupID.x; block < block_count(); block += gl_NumWorkGroups.x) {
    const vec4 sum = block_sum(block);
    if (gl_LocalInvocationIndex == 0u) blocks.v[kind * block_count() + block] = sum.x;
  }
}
