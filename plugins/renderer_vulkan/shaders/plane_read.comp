#version 460
// SPDX-License-Identifier: Apache-2.0
// What steers the filter, and light without what the brightest paths bring beyond belief.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

// Where the samples of a pixel met surfaces that face many ways (glass, edges), their means say
// little of how alike two such pixels are.
const float kMixedTolerance = 100.0;
// Of the paths of one pixel: what so many may bring each, one of more may bring for all of them.
const float kLimitedPaths = 16.0;
// A path may be so many times as bright as the others around it, whatever the limit.
const float kTimesOthers = 4.0;
const float kMostVariance = 1e30;

struct Believed {
  vec3 scattered;
  float variance;
  float removed;
};

Believed believable(FilmPixel pixel, int x, int y) {
  Believed as_it_is = {pixel.scattered, pixel.variance, 0.0};
  const float times = max(1.0, pixel.count / kLimitedPaths);
  const bool is_limited = brightest_path > 0.0 && pixel.count > 1.5;
  if (!is_limited || pixel.brightest <= brightest_path * times) return as_it_is;
  float others = 0.0;
  float count = 0.0;
  for (int v = max(0, y - 1); v < min(int(height), y + 2); ++v) {
    for (int u = max(0, x - 1); u < min(int(width), x + 2); ++u) {
      const FilmPixel near = film.v[uint(v) * width + uint(u)];
      others += luminance(near.scattered) * near.count - near.brightest;
      count += near.count - 1.0;
    }
  }
  const float most = times * (brightest_path + kTimesOthers * max(0.0, others) / count);
  const float own = luminance(pixel.scattered);
  const float removed = min(own, (pixel.brightest - most) / pixel.count);
  if (!(removed > 0.0)) return as_it_is;
  // As if that path had been as bright as it may be. What both sums of squares have in common
  // cancels out before it is rounded.
  const float n = pixel.count;
  const float less = own - removed;
  const float squares_less =
      (pixel.brightest - most) * ((pixel.brightest + most) / n) - removed * (own + less);
  const float variance = pixel.variance - squares_less / (n - 1.0);
  Believed believed = {pixel.scattered * (less / own), clamp(variance, 0.0, kMostVariance), removed};
  return believed;
}

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    const FilmPixel pixel = film.v[i];
    const float len = length(pixel.normal);
    const bool has_surface = pixel.surface_share > 0.0;
    vec3 normal = len > 1e-6 ? pixel.normal / len : vec3(0.0, 0.0, 1.0);
    if (!has_surface) normal = vec3(0.0);
    const float confidence =
        has_surface ? 1.0 / (1.0 + kMixedTolerance * max(0.0, 1.0 - len)) : kNoSurface;
    NORMAL(i) = vec4(normal, confidence);
    POSITION(i) = vec4(pixel.position - view_position, 0.0);
    const vec3 color = max(pixel.albedo, vec3(kMinAlbedo));
    const Believed believed = believable(pixel, int(i % width), int(i / width));
    const vec4 light = with_luminance(believed.scattered / color);
    const float own_color = luminance(color);
    LIGHT(from, i) = light;
    VARIANCE(from, i) = believed.variance / (own_color * own_color);
    support.v[i] = light.w + believed.removed / own_color;
  }
}
