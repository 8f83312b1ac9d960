#version 460
// SPDX-License-Identifier: Apache-2.0
// Certainty is 1 / the difference of luminance that noise explains; half of it, because two pixels have
// a say, and scaled for exp16(). Variances of few samples are noisy themselves: they are smoothed.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

const float kLuminanceSlack = 4.0;  // standard deviations

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    const int x = int(i % width);
    const int y = int(i / width);
    float sum = 0.0;
    float weights = 0.0;
    for (int v = max(0, y - 1); v < min(int(height), y + 2); ++v) {
      for (int u = max(0, x - 1); u < min(int(width), x + 2); ++u) {
        const uint other = uint(v) * width + uint(u);
        const float w = (u == x ? 2.0 : 1.0) * (v == y ? 2.0 : 1.0);
        const vec4 normal = NORMAL(other);
        sum += w * VARIANCE(from, other);
        if (is_surface(normal)) weights += w;
      }
    }
    const vec4 own = LIGHT(from, i);
    const float explained = kLuminanceSlack * sqrt(sum / max(weights, 1.0)) + 1e-4 * own.w + 1e-8;
    CERTAINTY(i) = (0.5 / 16.0) / explained;
  }
}
