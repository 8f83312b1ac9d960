// SPDX-License-Identifier: Apache-2.0
// What paths carry from kernel to kernel, by columns: an entry of every column per path. A kernel reads
// an entry as a whole and once: asked for .w of one that was read before, Mesa 22.3 gives its .x.
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Columns { vec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Queue { uint v[]; };

// 64 paths: one sample of each pixel of a block.
struct SampleSlot {
  uint x;
  uint y;
  uint columns;
  uint rows;
  uint key;
  uint sample_index;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer SampleSlots { SampleSlot v[]; };

// Slots of one block that stand side by side.
struct SlotRange {
  uint first;
  uint count;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer SlotRanges { SlotRange v[]; };

struct PixelSum {
  vec3 seen;
  vec3 scattered;
  vec3 albedo;
  vec3 normal;
  vec3 position;
  float mean;     // of the luminance of what was scattered ...
  float squares;  // ... and the sum of its squared deviations
  float brightest;
  uint count;
  uint surfaces;
  uint chances;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer PixelSums { PixelSum v[]; };

#include "film.glsl"
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer FilmPixels { FilmPixel v[]; };

// See VirtualLights::Light.
struct VirtualLight {
  vec3 normal;
  vec3 to_light;
  vec3 irradiance;
  uint pad;
  Surface surface;
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer VirtualLights { VirtualLight v[]; };

// Counts and the arguments of the next dispatches.
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Counters {
  uint paths_groups[3];
  uint shadow_groups[3];
  uint connection_groups[3];
  uint path_count;    // of the queue that is worked on
  uint next_count;    // of the queue that is filled
  uint shadow_count;  // likewise
  uint ready_shadow_count;  // of the queue of shadow rays that is worked on
  uint connection_count;    // of the rays to virtual lights, likewise
  uint ready_connection_count;
  uint is_over_limit;  // a kernel would have looped more often than the device can
  uint rays;
  uint shadow_rays;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Job {
  Counters counters;
  SampleSlots slots;
  SlotRanges ranges;
  Columns state;
  Columns results;
  Columns hits;
  Queue hit_triangles;
  Columns shadows;
  Columns connections;  // as shadows, to virtual lights
  Queue queues[2];
  Columns camera_rays;  // three entries per path, where the lens is no pinhole
  PixelSums sums;
  FilmPixels film;
  Vec4s cache;  // light and key
  Columns findings;  // four entries per path, where a cache learns
  Vec4s candidates;  // position and density, normal and brightness of each virtual light
  VirtualLights virtual_lights;
  Uints part_starts;     // of instances ...
  Uints part_triangles;  // ... among these: three words each, SurfaceParts::Triangle
  Floats part_densities;  // two sides each
  uint virtual_light_count;
  uint cache_mask;
  uint cache_use;
  uint capacity;  // of the columns
  uint width;
  uint sample_bits;
  uint slot_count;
  uint pixel_count;
  uint has_camera_rays;
  uint starts_at_centres;
  uint iteration_limit;
  int max_bounces;
  float clamp_to;
  uint has_caustics;
  float indirect_share;
  float continuation;
  float most_spread;  // of a lobe, for what textures are read over
  float pixel_angle;
  vec3 cache_eye;
  vec3 camera;
  vec3 towards;
  vec3 per_column;
  vec3 per_row;
  float near;
  float far;
};

layout(push_constant, scalar) uniform Push {
  World world;
  Job job;
  uint queue;  // that is worked on
  uint connects;  // shadow rays go to virtual lights
};

const uint kGroup = 64u;

// Columns of the state.
const uint kOrigin = 0u;      // and flags
const uint kDirection = 1u;   // and metres since the last vertex
const uint kThroughput = 2u;  // and what was left behind the first surface
const uint kLastPosition = 3u;  // and its total score
const uint kLastNormal = 4u;    // and the density of the direction from there
// Width, spread, and the ray's range; or, of one that goes on through a surface, what it left.
const uint kFootprint = 5u;
const uint kSampler = 6u;       // key, dimension, place, and the time
const uint kBeside = 7u;  // with kHasShare: what light counts for beside virtual lights
const uint kStateColumns = 8u;

const uint kIsCameraRay = 1u << 16;
const uint kHasScattered = 1u << 17;
const uint kHidesLights = 1u << 18;
const uint kLastTwoSided = 1u << 19;
const uint kHasSurface = 1u << 20;
const uint kLeavesTriangle = 1u << 21;  // which it does not meet again
const uint kByChance = 1u << 22;  // chose between ways before the first surface

const uint kHasFinding = 1u << 23;  // for the cache
const uint kIsConnected = 1u << 24;  // with a virtual light, from the last vertex
const uint kHasShare = 1u << 25;

// What the cache is for.
const uint kCacheLearns = 1u;
const uint kCacheEnds = 2u;

// What the first result has beside the lights seen: the sum of these.
const float kSurface = 1.0;
const float kChance = 2.0;

#define STATE(column, path) job.state.v[(column) * job.capacity + (path)]
// Position and whether there is any, normal and reach, weight and what the cache's light is clamped
// to, light.
#define FINDING(path, entry) job.findings.v[4u * (path) + (entry)]
#define RESULT(column, path) job.results.v[(column) * job.capacity + (path)]
