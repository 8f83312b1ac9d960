#version 460
// SPDX-License-Identifier: Apache-2.0
// By how much the light around the middles of blocks was weakened.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

const float kMostReturned = 1.5;  // of the light that is left

void main() {
  const int columns = int(block_columns());
  const int rows = int(block_rows());
  for (uint block = gl_GlobalInvocationID.x; block < block_count(); block += invocation_count()) {
    const int column = int(block) % columns;
    const int row = int(block) / columns;
    float before = 0.0;
    float after = 1e-12;
    for (int v = max(0, row - 1); v < min(rows, row + 2); ++v) {
      for (int u = max(0, column - 1); u < min(columns, column + 2); ++u) {
        const float w = (v == row ? 2.0 : 1.0) * (u == column ? 2.0 : 1.0);
        const uint other = uint(v * columns + u);
        before += w * blocks.v[kBefore * block_count() + other];
        after += w * blocks.v[kAfter * block_count() + other];
      }
    }
    blocks.v[kLost * block_count() + block] = clamp(before / after, 1.0, kMostReturned);
  }
}
