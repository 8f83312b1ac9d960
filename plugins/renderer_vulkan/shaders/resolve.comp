#version 460
// SPDX-License-Identifier: Apache-2.0
// From sums to the picture's film; see PixelSum::mean() of renderer_support.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;
#include "world.glsl"
#include "job.glsl"

FilmPixel mean_of(PixelSum sum) {
  const float scale = sum.count > 0u ? 1.0 / float(sum.count) : 0.0;
  const float per_surface = sum.surfaces > 0u ? 1.0 / float(sum.surfaces) : 0.0;
  FilmPixel mean;
  mean.seen = sum.seen * scale;
  mean.scattered = sum.scattered * scale;
  mean.albedo = sum.albedo * scale;
  mean.normal = sum.normal * per_surface;
  mean.position = sum.position * per_surface;
  // One sample says nothing of its spread.
  mean.variance =
      sum.count > 1u ? sum.squares * scale / float(sum.count - 1u) : sum.mean * sum.mean;
  mean.brightest = sum.brightest;
  mean.count = float(sum.count);
  mean.surface_share = float(sum.surfaces) * scale;
  mean.chance_share = float(sum.chances) * scale;
  return mean;
}

void main() {
  const uint step = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
  for (uint pixel = gl_GlobalInvocationID.x; pixel < job.pixel_count; pixel += step) {
    job.film.v[pixel] = mean_of(job.sums.v[pixel]);
  }
}
