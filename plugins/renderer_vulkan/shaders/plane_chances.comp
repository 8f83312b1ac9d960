#version 460
// SPDX-License-Identifier: Apache-2.0
// Averages what paths that chose their way saw over the pixels around; see average_chances() of
// renderer_support.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

const float kPaths = 128.0;
const int kMostReach = 2;

void average(inout FilmPixel pixel, int x, int y) {
  int reach = 0;
  while (reach < kMostReach && float((2 * reach + 1) * (2 * reach + 1)) * pixel.count < kPaths) {
    ++reach;
  }
  vec3 albedo = vec3(0.0);
  vec3 normal = vec3(0.0);
  vec3 position = vec3(0.0);
  float shares = 0.0;
  float surfaces = 0.0;
  for (int v = max(0, y - reach); v < min(int(height), y + reach + 1); ++v) {
    for (int u = max(0, x - reach); u < min(int(width), x + reach + 1); ++u) {
      const FilmPixel near = film.v[uint(v) * width + uint(u)];
      const float weight =
          float((reach + 1 - abs(u - x)) * (reach + 1 - abs(v - y))) * near.chance_share;
      const float on_surfaces = weight * near.surface_share;
      albedo += weight * near.albedo;
      shares += weight;
      normal += on_surfaces * near.normal;
      position += on_surfaces * near.position;
      surfaces += on_surfaces;
    }
  }
  pixel.albedo += pixel.chance_share * (albedo / shares - pixel.albedo);
  if (!(surfaces > 0.0)) return;
  pixel.normal += pixel.chance_share * (normal / surfaces - pixel.normal);
  pixel.position += pixel.chance_share * (position / surfaces - pixel.position);
  pixel.surface_share += pixel.chance_share * (surfaces / shares - pixel.surface_share);
}

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    FilmPixel pixel = film.v[i];
    if (pixel.chance_share > 0.0) average(pixel, int(i % width), int(i / width));
    averaged.v[i] = pixel;
  }
}
