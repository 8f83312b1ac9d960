// SPDX-License-Identifier: Apache-2.0
// See FilmPixel of film.h.
struct FilmPixel {
  vec3 seen;
  vec3 scattered;
  vec3 albedo;
  vec3 normal;
  vec3 position;
  float variance;
  float brightest;
  float count;
  float surface_share;
  float chance_share;
};
