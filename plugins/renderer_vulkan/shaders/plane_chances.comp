#version 460
// SPDX-License-Identifier: Apache-2.0
// Averages what paths that chose their way saw over the pixels around; see average_chances() of
// renderer_support.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

const float kPaths = 128.0;
const int kMostReach = 2;

bool is_chance(FilmPixel pixel, float probability) {
  const float kLeastPaths = 4.0;
  const float found = pixel.count * (1.0 - pixel.surface_share);
  const float expected = pixel.count * probability;
  const float deviation = sqrt(expected * max(0.0, 1.0 - probability));
  return pixel.count >= kLeastPaths && abs(found - expected) <= 2.0 * deviation + 0.5 &&
         deviation > 0.1 * expected;
}

void average(inout FilmPixel pixel, int x, int y) {
  int reach = 0;
  while (reach < kMostReach && float((2 * reach + 1) * (2 * reach + 1)) * pixel.count < kPaths) {
    ++reach;
  }
  const int looked_at = max(reach, 1);
  vec3 albedo = vec3(0.0);
  vec3 normal = vec3(0.0);
  vec3 position = vec3(0.0);
  float shares = 0.0;
  float surfaces = 0.0;
  vec3 lights = vec3(0.0);
  float light_weights = 0.0;
  int lit = 0;
  int neighbours = 0;
  float without_surface = 0.0;
  for (int v = max(0, y - looked_at); v < min(int(height), y + looked_at + 1); ++v) {
    for (int u = max(0, x - looked_at); u < min(int(width), x + looked_at + 1); ++u) {
      const FilmPixel near = film.v[uint(v) * width + uint(u)];
      const int away_x = abs(u - x);
      const int away_y = abs(v - y);
      const float weight = float((reach + 1 - away_x) * (reach + 1 - away_y)) * near.chance_share;
      const float on_surfaces = weight * near.surface_share;
      albedo += weight * near.albedo;
      shares += weight;
      normal += on_surfaces * near.normal;
      position += on_surfaces * near.position;
      surfaces += on_surfaces;
      if (away_x > 1 || away_y > 1) continue;
      const float light_weight = float((2 - away_x) * (2 - away_y)) * near.chance_share;
      lights += light_weight * near.seen;
      light_weights += light_weight;
      if (away_x + away_y == 0 || !(near.chance_share > 0.0)) continue;
      if (luminance(near.seen) > 0.0) ++lit;
      ++neighbours;
      without_surface += 1.0 - near.surface_share;
    }
  }
  const float share = pixel.chance_share;
  pixel.albedo += share * (albedo / shares - pixel.albedo);
  if (lit >= 4 && is_chance(pixel, without_surface / float(neighbours))) {
    pixel.seen += share * (lights / light_weights - pixel.seen);
  }
  if (!(surfaces > 0.0)) return;
  pixel.normal += share * (normal / surfaces - pixel.normal);
  pixel.position += share * (position / surfaces - pixel.position);
  pixel.surface_share += share * (surfaces / shares - pixel.surface_share);
}

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    FilmPixel pixel = film.v[i];
    if (pixel.chance_share > 0.0) average(pixel, int(i % width), int(i / width));
    averaged.v[i] = pixel;
  }
}
