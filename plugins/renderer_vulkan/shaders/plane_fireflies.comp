#version 460
// SPDX-License-Identifier: Apache-2.0
// Samples that are far brighter than everything around them are chance finds; the brightest
// believable value is the third brightest neighbour's.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    const int x = int(i % width);
    const int y = int(i / width);
    float first = 0.0;
    float second = 0.0;
    float third = 0.0;
    uint neighbours = 0u;
    for (int v = max(0, y - 2); v < min(int(height), y + 3); ++v) {
      for (int u = max(0, x - 2); u < min(int(width), x + 3); ++u) {
        const uint other = uint(v) * width + uint(u);
        const vec4 normal = NORMAL(other);
        if (other == i || !is_surface(normal)) continue;
        ++neighbours;
        const vec4 light = LIGHT(from, other);
        const float below_first = min(first, light.w);
        first = max(first, light.w);
        const float below_second = min(second, below_first);
        second = max(second, below_first);
        third = max(third, below_second);
      }
    }
    const vec4 own_normal = NORMAL(i);
    const vec4 own = LIGHT(from, i);
    const bool is_suspect = is_surface(own_normal) && neighbours >= 8u && own.w > third;
    const float scale = is_suspect ? third / max(own.w, 1e-30) : 1.0;
    LIGHT(1u - from, i) = with_luminance(own.xyz * scale);
    VARIANCE(1u - from, i) = VARIANCE(from, i) * scale * scale;
  }
}
