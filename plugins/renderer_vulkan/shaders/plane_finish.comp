#version 460
// SPDX-License-Identifier: Apache-2.0
// The picture: light on surfaces, of outliers no more than what surrounds them has, and with the light
// that was cut off or left out spread over a wide neighbourhood; then the surfaces' colours.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

// Below this share of agreeing neighbours a pixel was hardly averaged: edges, thin things.
const float kLowSupport = 0.35;
// So many averaged pixels near one of low support make it suspect.
const uint kValidNeighbours = 10u;
const float kLeeway = 2.0;  // by which it may leave their range

// Pixels that agree with none of their neighbours, mostly mixtures at edges, keep their noise; they
// may at least be no darker and no brighter than what surrounds them.
float outlier_scale(int x, int y, float own) {
  float low = 3e38;
  float high = 0.0;
  uint valid_neighbours = 0u;
  for (int v = max(0, y - 2); v < min(int(height), y + 3); ++v) {
    for (int u = max(0, x - 2); u < min(int(width), x + 3); ++u) {
      const uint other = uint(v) * width + uint(u);
      const vec4 normal = NORMAL(other);
      if (!is_surface(normal) || support.v[other] < kLowSupport) continue;
      const vec4 light = LIGHT(from, other);
      ++valid_neighbours;
      low = min(low, light.w);
      high = max(high, light.w);
    }
  }
  if (valid_neighbours < kValidNeighbours || !(own > 0.0)) return 1.0;
  return min(max(own, low * (1.0 / kLeeway)), high * kLeeway) / max(own, 1e-30);
}

float lost(int column, int row) {
  const uint u = uint(clamp(column, 0, int(block_columns()) - 1));
  const uint v = uint(min(row, int(block_rows()) - 1));
  return blocks.v[kLost * block_count() + v * block_columns() + u];
}

// Between the middles of blocks.
float returned(int x, int y) {
  const float v = max(0.0, (float(y) + 0.5) / float(kBlock) - 0.5);
  const int upper = int(v);
  const float u = (float(x) + 0.5) / float(kBlock) - 0.5;
  const int left = int(floor(u));
  const float down = v - float(upper);
  return mix(mix(lost(left, upper), lost(left, upper + 1), down),
             mix(lost(left + 1, upper), lost(left + 1, upper + 1), down), u - float(left));
}

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    const int x = int(i % width);
    const int y = int(i / width);
    const vec4 normal = NORMAL(i);
    const vec4 light = LIGHT(from, i);
    float scale = returned(x, y);
    if (is_surface(normal) && support.v[i] < kLowSupport) scale *= outlier_scale(x, y, light.w);
    const FilmPixel pixel = film.v[i];
    image.v[i] = pixel.seen + light.xyz * scale * max(pixel.albedo, vec3(kMinAlbedo));
  }
}
