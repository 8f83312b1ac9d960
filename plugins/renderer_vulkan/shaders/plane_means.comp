#version 460
// SPDX-License-Identifier: Apache-2.0
// Mean light of blocks of pixels, for the picture's exposure. A group per block.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"
#include "block_sum.glsl"

float finite(float value) {
  return isnan(value) || isinf(value) ? 0.0 : clamp(value, -1e15, 1e15);
}

vec4 value_of(uint pixel) {
  const FilmPixel p = film.v[pixel];
  const vec3 light = p.seen + p.scattered;
  return vec4(finite(light.x), finite(light.y), finite(light.z), 1.0);
}

void main() {
  for (uint block = gl_WorkGroupID.x; block < block_count(); block += gl_NumWorkGroups.x) {
    const vec4 sum = block_sum(block);
    if (gl_LocalInvocationIndex > 0u) continue;
    for (uint k = 0u; k < 3u; ++k) blocks.v[3u * block + k] = sum[k] / sum.w;
  }
}
