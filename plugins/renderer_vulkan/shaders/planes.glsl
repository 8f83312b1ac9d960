// SPDX-License-Identifier: Apache-2.0
// What the steps of the filter on planes share; see plane_filter.h of renderer_support, whose numbers
// these are.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;

#include "film.glsl"
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer FilmPixels { FilmPixel v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer AveragedFilm { FilmPixel v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Vec4s { vec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Vec3s { vec3 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Floats { float v[]; };

layout(push_constant, scalar) uniform Push {
  FilmPixels film;
  Vec4s layers;   // by kinds, an entry of each per pixel; see below
  Floats noise;   // likewise
  Floats support;  // until the first round what a pixel weighs, then how many neighbours agreed
  Floats blocks;  // of 16 x 16 pixels, by kinds
  Vec3s image;
  uint width;
  uint height;
  uint from;   // 0 or 1: which of the lights are read; the other ones are written
  uint reach;  // of a round
  vec3 view_position;
  float brightest_path;
  AveragedFilm averaged;  // the next steps' film
};

// Kinds of layers.
const uint kNormals = 0u;    // and how much differences from the pixel mean
const uint kPositions = 1u;  // as seen from the camera
const uint kLights = 2u;     // two of them: irradiance and its luminance
// Kinds of noise.
const uint kVariances = 0u;  // of the luminances of both
const uint kCertainty = 2u;
// Kinds of blocks.
const uint kBefore = 0u;
const uint kAfter = 1u;
const uint kLost = 2u;  // how many times the light is given back

const int kBlock = 16;
const float kMinAlbedo = 0.02;
const float kNoSurface = 1e6;

#define NORMAL(pixel) layers.v[kNormals * pixel_count() + (pixel)]
#define POSITION(pixel) layers.v[kPositions * pixel_count() + (pixel)]
#define LIGHT(which, pixel) layers.v[(kLights + (which)) * pixel_count() + (pixel)]
#define VARIANCE(which, pixel) noise.v[(kVariances + (which)) * pixel_count() + (pixel)]
#define CERTAINTY(pixel) noise.v[kCertainty * pixel_count() + (pixel)]

uint pixel_count() { return width * height; }
uint block_columns() { return (width + uint(kBlock) - 1u) / uint(kBlock); }
uint block_rows() { return (height + uint(kBlock) - 1u) / uint(kBlock); }
uint block_count() { return block_columns() * block_rows(); }
uint invocation_count() { return gl_NumWorkGroups.x * gl_WorkGroupSize.x; }

float luminance(vec3 rgb) { return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z; }
vec4 with_luminance(vec3 rgb) { return vec4(rgb, luminance(rgb)); }
bool is_surface(vec4 normal) { return normal.w < kNoSurface; }
