// SPDX-License-Identifier: Apache-2.0
// See light_table.h, light_tree.h, light_choice.h, light_samples.h, dome.h and sky_grid.h of
// renderer_support.
struct Receiver {
  vec3 position;
  vec3 normal;
  bool is_two_sided;
  float total_score;
};

const uint kLanes = 8u;
const uint kBlockWords = 116u;  // 13 numbers and a child per lane, then count, parent, lane of it

float lane_number(uint block, uint number, uint lane) {
  return uintBitsToFloat(world.light_blocks.v[block * kBlockWords + number * kLanes + lane]);
}
int lane_child(uint block, uint lane) {
  return int(world.light_blocks.v[block * kBlockWords + 13u * kLanes + lane]);
}
uint block_count(uint block) { return world.light_blocks.v[block * kBlockWords + 14u * kLanes]; }

float tree_score(uint block, uint lane, Receiver receiver) {
  const float kFloor = 0.1;
  const vec3 to = vec3(lane_number(block, 0u, lane), lane_number(block, 1u, lane),
                       lane_number(block, 2u, lane)) -
                  receiver.position;
  const float radius = lane_number(block, 3u, lane);
  const float near2 = max(dot(to, to), radius * radius + 1e-20);
  const float scale = 1.0 / sqrt(near2);
  const float along = dot(receiver.normal, to);
  const float towards = receiver.is_two_sided ? abs(along) : along;
  const float cosine = (towards + radius * 1.001) * scale;
  const float at_receiver = cosine > 0.0 ? max(kFloor, min(1.0, cosine)) : 0.0;
  const float height = -dot(to, vec3(lane_number(block, 5u, lane), lane_number(block, 6u, lane),
                                     lane_number(block, 7u, lane)));
  const float depth = lane_number(block, 8u, lane);
  const float facing =
      min(1.0, lane_number(block, 9u, lane) * ((height + depth) * scale) +
                   lane_number(block, 10u, lane));
  const float shining = facing * (1.0 + lane_number(block, 11u, lane) * (facing - 1.0));
  const float at_light = facing > 0.0 ? max(kFloor, shining) : lane_number(block, 12u, lane);
  return lane_number(block, 4u, lane) * at_receiver * at_light * scale * scale;
}

// Of a sky: low corner, cells per metre, counts, the cells' powers, then 129 borders of each. Of a
// distant light: the same with shares, and no borders.
const uint kPatches = 128u;
const uint kFirstCell = 9u;

uint grid_cell(Uints grid, vec3 position) {
  uvec3 place;
  for (int k = 0; k < 3; ++k) {
    const float x = (position[k] - uintBitsToFloat(grid.v[k])) * uintBitsToFloat(grid.v[3 + k]);
    place[k] = uint(max(0.0, min(x, float(grid.v[6 + k] - 1u))));
  }
  return (place.z * grid.v[7] + place.y) * grid.v[6] + place.x;
}
// Of a sky its power there, of a distant light the share of the cell that sees it.
float seen_of(Uints grid, vec3 position) {
  return uintBitsToFloat(grid.v[kFirstCell + grid_cell(grid, position)]);
}
uint first_border(Uints grid, vec3 position) {
  return kFirstCell + grid.v[6] * grid.v[7] * grid.v[8] +
         grid_cell(grid, position) * (kPatches + 1u);
}
float border(Uints words, uint first, uint i) { return uintBitsToFloat(words.v[first + i]); }

// The interval of ascending borders, of `count` + 1 from 0 to 1, that u falls into.
uint interval_of(Uints words, uint first, uint count, float u) {
  uint low = 0u;
  uint high = count - 1u;
  while (low < high) {
    const uint middle = (low + high + 1u) / 2u;
    if (border(words, first, middle) <= u) {
      low = middle;
    } else {
      high = middle - 1u;
    }
  }
  return low;
}

float score_of_surroundings(uint light, Receiver receiver) {
  Uints grid = world.lights.v[light].grid;
  const float power = world.lights.v[light].power * seen_of(grid, receiver.position);
  if (world.lights.v[light].shape == kDome) return power;
  const float kFloor = 0.1;
  const float size = world.lights.v[light].one_minus_cos;
  const float reach = sqrt(size * (2.0 - size)) + 1e-3;
  const float facing = -dot(receiver.normal, world.lights.v[light].direction);
  const float cosine = reach + (receiver.is_two_sided ? abs(facing) : facing);
  return cosine > 0.0 ? power * max(kFloor, min(1.0, cosine)) : 0.0;
}

float entry_score(uint entry, Receiver receiver) {
  if (entry < world.root_count) return tree_score(0u, entry, receiver);
  return score_of_surroundings(world.surroundings.v[entry - world.root_count], receiver);
}

// Sets the receiver's total score. Returns the light; its probability is zero if none contributes.
uint choose_light(inout Receiver receiver, float u, out float probability) {
  float total = 0.0;
  for (uint entry = 0u; entry < world.entry_count; ++entry) total += entry_score(entry, receiver);
  receiver.total_score = total;
  probability = 0.0;
  uint picked = kNone;
  float score = 0.0;
  float before = 0.0;
  float end = 0.0;
  for (uint entry = 0u; entry < world.entry_count; ++entry) {
    const float own = entry_score(entry, receiver);
    if (own > 0.0 && u * total >= end) {
      picked = entry;
      score = own;
      before = end;
      end += own;
    }
  }
  if (picked == kNone) return 0u;
  probability = score / total;
  const int light = world.entry_lights.v[picked];
  if (light >= 0) return uint(light);
  // A group of the tree.
  float rest = clamp((u * total - before) / score, 0.0, 0.9999999);
  int child = lane_child(0u, picked);
  for (uint guard = 0u; child < 0 && guard < 64u; ++guard) {
    const uint block = uint(~child);
    const uint count = block_count(block);
    float sum = 0.0;
    for (uint i = 0u; i < count; ++i) sum += tree_score(block, i, receiver);
    if (!(sum > 0.0)) {
      probability = 0.0;
      return 0u;
    }
    const float target = rest * sum;
    float before_lane = 0.0;
    float end_lane = 0.0;
    float lane_score = 1.0;
    uint lane = 0u;
    for (uint i = 0u; i < count; ++i) {
      const float own = tree_score(block, i, receiver);
      if (!(own > 0.0)) continue;
      lane = i;
      lane_score = own;
      before_lane = end_lane;
      end_lane += own;
      if (target < end_lane) break;
    }
    probability *= lane_score / sum;
    rest = clamp((target - before_lane) / lane_score, 0.0, 0.9999999);
    child = lane_child(block, lane);
  }
  return world.light_bodies.v[uint(child)];
}

// With which choose_light() picks this light for the receiver.
float choice_probability(uint light, Receiver receiver) {
  const float total = receiver.total_score;
  if (!(total > 0.0)) return 0.0;
  const uint shape = world.lights.v[light].shape;
  if (shape == kDistant || shape == kDome) return score_of_surroundings(light, receiver) / total;
  const uint place = 2u * world.light_order.v[light];
  uint block = world.light_places.v[place];
  uint lane = world.light_places.v[place + 1u];
  float probability = 1.0;
  for (uint guard = 0u; guard < 64u; ++guard) {
    const uint count = block_count(block);
    float sum = 0.0;
    float own = 0.0;
    for (uint i = 0u; i < count; ++i) {
      const float score = tree_score(block, i, receiver);
      sum += score;
      if (i == lane) own = score;
    }
    if (!(own > 0.0)) return 0.0;
    probability *= own / sum;
    if (block == 0u) return probability * (sum / total);
    const uint words = block * kBlockWords + 14u * kLanes;
    lane = world.light_blocks.v[words + 2u];
    block = world.light_blocks.v[words + 1u];
  }
  return 0.0;
}

// Of a dome: the image's patches, 16 x 8 of them. Per patch width, height and where its weights, row
// sums and sums within rows begin.
const uint kColumns = 16u;
const uint kPatchRows = 8u;
const uint kPatchWords = 5u;

float inverse_place(Uints words, uint first, uint count, float u) {
  const uint i = interval_of(words, first, count, u);
  const float begin = border(words, first, i);
  const float size = border(words, first, i + 1u) - begin;
  const float rest = size > 0.0 ? (u - begin) / size : 0.5;
  return float(i) + clamp(rest, 0.0, 0.99999);
}

vec2 patch_sample(Uints patches, uint sky_patch, vec2 u, out float density) {
  const uint k = sky_patch * kPatchWords;
  const uint width = patches.v[k];
  const uint height = patches.v[k + 1u];
  const float y = inverse_place(patches, patches.v[k + 3u], height, u.y);
  const uint row = uint(y);
  const float x = inverse_place(patches, patches.v[k + 4u] + row * (width + 1u), width, u.x);
  density = uintBitsToFloat(patches.v[patches.v[k + 2u] + row * width + uint(x)]);
  const vec2 point = vec2(x / float(width), y / float(height));
  return (vec2(float(sky_patch % kColumns), float(sky_patch / kColumns)) + point) /
         vec2(float(kColumns), float(kPatchRows));
}

float per_solid_angle(float sine) {
  return float(kPatches) / (2.0 * kPi * kPi * max(1e-4, sine));
}

uint cell_of(float x, uint count) { return uint(clamp(int(x * float(count)), 0, int(count) - 1)); }

vec3 dome_radiance(uint light, vec2 p) {
  const vec3 texel =
      lookup(world.lights.v[light].texture, vec2(p.x, 1.0 - p.y), 0.0, kRepeat, kClamp).xyz;
  return world.lights.v[light].radiance * max(texel, vec3(0.0));
}

float cone_factor(uint light, vec3 from_light) {
  const float outer = world.lights.v[light].cos_outer;
  if (outer < -1.0) return 1.0;
  const float c = dot(from_light, world.lights.v[light].direction);
  const float t = clamp((c - outer) / (world.lights.v[light].cos_inner - outer), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

struct LightSample {
  vec3 direction;
  float distance;
  float density;  // zero: nothing arrives; kInfinite: the radiance is an irradiance
  vec3 radiance;
};

void sample_triangles(uint light, vec3 from, vec2 u, inout LightSample s) {
  Vec4s triangles = world.lights.v[light].triangles;
  const uint count = world.lights.v[light].triangle_count;
  const float area = world.lights.v[light].area;
  const uint flags = world.lights.v[light].flags;
  if (count == 0u) return;
  const float target = u.x * area;
  uint low = 0u;
  uint high = count - 1u;
  while (low < high) {
    const uint middle = (low + high) / 2u;
    if (triangles.v[3u * middle + 1u].w > target) {
      high = middle;
    } else {
      low = middle + 1u;
    }
  }
  const float before = low == 0u ? 0.0 : triangles.v[3u * low - 2u].w;
  const vec4 corner = triangles.v[3u * low];
  const vec4 ab = triangles.v[3u * low + 1u];
  const vec3 ac = triangles.v[3u * low + 2u].xyz;
  const float size = ab.w - before;
  const float again = size > 0.0 ? clamp((target - before) / size, 0.0, 0.999999) : 0.5;
  const float root = sqrt(again);
  const vec2 weights = vec2(root * (1.0 - u.y), root * u.y);
  const vec3 to_light = corner.xyz + weights.x * ab.xyz + weights.y * ac - from;
  const float distance2 = dot(to_light, to_light);
  const float distance = sqrt(distance2);
  const vec3 direction = to_light / distance;
  const float cosine = -dot(direction, unit(cross(ab.xyz, ac)));
  const bool is_front = (cosine < 0.0) == ((flags & kLightMirrored) != 0u);
  if (!(abs(cosine) > 1e-6) || !(is_front || (flags & kLightDoubleSided) != 0u)) return;
  s.direction = direction;
  s.distance = distance;
  s.density = distance2 / (abs(cosine) * area);
  const uint instance = world.lights.v[light].instance;
  const uint number = floatBitsToUint(corner.w);
  s.radiance = emission_at(material_of(instance, number),
                           uv_at(instance, number, weights.x, weights.y), 0.0);
}

void sample_dome(uint light, vec3 from, vec2 u, inout LightSample s) {
  Uints grid = world.lights.v[light].grid;
  const uint first = first_border(grid, from);
  const uint sky_patch = interval_of(grid, first, kPatches, u.x);
  const float begin = border(grid, first, sky_patch);
  const float share = border(grid, first, sky_patch + 1u) - begin;
  if (!(share > 0.0)) return;
  const float rest = clamp((u.x - begin) / share, 0.0, 0.9999999);
  float density;
  Uints patches = world.lights.v[light].patches;
  const vec2 place = patch_sample(patches, sky_patch, vec2(rest, u.y), density);
  const vec2 height = unit_circle(0.5 * place.y);
  const vec2 around = unit_circle(place.x);
  const vec3 local = vec3(-height.y * around.x, height.y * around.y, height.x);
  s.direction = unit(world.lights.v[light].dome_from_world[0] * local.x +
                     world.lights.v[light].dome_from_world[1] * local.y +
                     world.lights.v[light].dome_from_world[2] * local.z);
  s.distance = kInfinite;
  s.density = density * share * per_solid_angle(height.y);
  s.radiance = dome_radiance(light, place);
}

// A point of the light; u places it.
LightSample sample_light(uint light, vec3 from, vec2 u) {
  LightSample s = LightSample(vec3(0.0, 0.0, 1.0), 0.0, 0.0, vec3(0.0));
  const uint shape = world.lights.v[light].shape;
  if (shape == kTriangles) {
    sample_triangles(light, from, u, s);
    return s;
  }
  if (shape == kDome) {
    sample_dome(light, from, u, s);
    return s;
  }
  const vec3 along = world.lights.v[light].direction;
  if (shape == kDistant) {
    const float size = world.lights.v[light].one_minus_cos;
    const bool has_size = size > 0.0;
    s.direction = has_size ? unit(to_world(basis_around(-along), uniform_cone(u, size))) : -along;
    s.distance = kInfinite;
    s.density = has_size ? 1.0 / (2.0 * kPi * size) : kInfinite;
  } else {
    const vec3 to_centre = world.lights.v[light].position - from;
    const float radius2 = world.lights.v[light].radius * world.lights.v[light].radius;
    const float centre2 = dot(to_centre, to_centre);
    if (shape == kSphere) {
      const float sin2 = radius2 / centre2;
      const float distance = sqrt(centre2);
      const float one_minus_cos = one_minus_cos_of(sin2);
      const vec3 local = uniform_cone(u, one_minus_cos);
      s.direction = unit(to_world(basis_around(to_centre * (1.0 / distance)), local));
      const float sine2 = max(0.0, 1.0 - local.z * local.z);
      s.distance = distance * local.z - sqrt(max(0.0, radius2 - centre2 * sine2));
      s.density = sin2 < 1.0 ? 1.0 / (2.0 * kPi * one_minus_cos) : 0.0;
    } else if (shape == kTurningDisk) {
      const mat3 basis = basis_around(unit(to_centre));
      const vec2 p = disk_from_square(u) * world.lights.v[light].radius;
      const vec3 to_light = to_centre + p.x * basis[0] + p.y * basis[1];
      const float distance2 = dot(to_light, to_light);
      s.distance = sqrt(distance2);
      s.direction = to_light * (1.0 / s.distance);
      s.density = centre2 > radius2
                      ? distance2 * s.distance / (sqrt(centre2) * world.lights.v[light].area)
                      : 0.0;
    } else {
      const vec2 p = shape == kDisk ? disk_from_square(u) : 2.0 * u - 1.0;
      const vec3 to_light =
          to_centre + p.x * world.lights.v[light].axis_x + p.y * world.lights.v[light].axis_y;
      const float distance2 = dot(to_light, to_light);
      s.distance = sqrt(distance2);
      s.direction = to_light * (1.0 / s.distance);
      const float cosine = -dot(s.direction, along);
      s.density = cosine > 1e-6 ? distance2 / (cosine * world.lights.v[light].area) : 0.0;
    }
  }
  s.radiance = world.lights.v[light].radiance * cone_factor(light, -s.direction);
  return s;
}

bool is_near(uint light, vec3 from, vec3 direction) {
  const vec3 to = world.lights.v[light].position - from;
  const float along = dot(to, direction);
  const vec3 off = to - along * direction;
  const float radius = world.lights.v[light].radius;
  return dot(off, off) < radius * radius && along + radius > 0.0;
}

// What a ray meets of a light without a mesh: its radiance, and the density of sample_light() from
// `from`; zero: nothing.
float intersect_light(uint light, vec3 from, vec3 direction, float t_min, float t_max,
                      out vec3 radiance) {
  radiance = world.lights.v[light].radiance;
  const uint shape = world.lights.v[light].shape;
  if (shape == kDome) {
    const vec3 d = vec3(dot(world.lights.v[light].dome_from_world[0], direction),
                        dot(world.lights.v[light].dome_from_world[1], direction),
                        dot(world.lights.v[light].dome_from_world[2], direction));
    const bool is_pole = d.x == 0.0 && d.y == 0.0;
    const float u = 0.5 - (is_pole ? 0.0 : atan(d.y, d.x)) / (2.0 * kPi);
    const float v = acos(clamp(d.z, -1.0, 1.0)) / kPi;
    const vec2 p = clamp(vec2(u, v), vec2(0.0), vec2(1.0));
    const uint column = cell_of(p.x, kColumns);
    const uint row = cell_of(p.y, kPatchRows);
    const uint sky_patch = row * kColumns + column;
    const vec2 within = p * vec2(float(kColumns), float(kPatchRows)) - vec2(float(column), float(row));
    const float sine = sqrt(max(0.0, 1.0 - d.z * d.z));
    Uints patches = world.lights.v[light].patches;
    const uint k = sky_patch * kPatchWords;
    const uint width = patches.v[k];
    const uint at = cell_of(within.y, patches.v[k + 1u]) * width + cell_of(within.x, width);
    const float density = uintBitsToFloat(patches.v[patches.v[k + 2u] + at]) * per_solid_angle(sine);
    Uints grid = world.lights.v[light].grid;
    const uint first = first_border(grid, from);
    radiance = dome_radiance(light, p);
    return density * (border(grid, first, sky_patch + 1u) - border(grid, first, sky_patch));
  }
  const vec3 along = world.lights.v[light].direction;
  if (shape == kDistant) {
    const float size = world.lights.v[light].one_minus_cos;
    if (size <= 0.0) return 0.0;
    const vec3 apart = direction + along;
    return 0.5 * dot(apart, apart) > size ? 0.0 : 1.0 / (2.0 * kPi * size);
  }
  const vec3 to_centre = world.lights.v[light].position - from;
  const float radius2 = world.lights.v[light].radius * world.lights.v[light].radius;
  const float area = world.lights.v[light].area;
  radiance *= cone_factor(light, -direction);
  if (shape == kSphere) {
    const float distance2 = dot(to_centre, to_centre);
    if (distance2 <= radius2) return 0.0;
    const float towards = dot(to_centre, direction);
    const vec3 off = to_centre - towards * direction;
    const float off2 = dot(off, off);
    if (towards <= 0.0 || off2 >= radius2) return 0.0;
    const float t = towards - sqrt(radius2 - off2);
    if (t < t_min || t >= t_max) return 0.0;
    return 1.0 / (2.0 * kPi * one_minus_cos_of(radius2 / distance2));
  }
  if (shape == kTurningDisk) {
    const float height2 = dot(to_centre, to_centre);
    const float towards = dot(to_centre, direction);
    if (towards <= 0.0 || height2 <= radius2) return 0.0;
    const float t = height2 / towards;
    const vec3 off = t * direction - to_centre;
    if (t < t_min || t >= t_max || dot(off, off) >= radius2) return 0.0;
    return t * t * t / (sqrt(height2) * area);
  }
  if (shape != kRect && shape != kDisk) return 0.0;
  const float cosine = -dot(direction, along);
  if (cosine <= 1e-6) return 0.0;
  const float t = dot(-to_centre, along) / cosine;
  if (t <= t_min || t >= t_max) return 0.0;
  const vec3 p = t * direction - to_centre;
  const vec3 axis_x = world.lights.v[light].axis_x;
  const vec3 axis_y = world.lights.v[light].axis_y;
  const vec3 normal = cross(axis_x, axis_y);
  const float scale = 1.0 / dot(normal, normal);
  const float x = dot(cross(p, axis_y), normal) * scale;
  const float y = dot(cross(axis_x, p), normal) * scale;
  const bool is_inside = shape == kDisk ? x * x + y * y < 1.0 : abs(x) < 1.0 && abs(y) < 1.0;
  return is_inside ? t * t / (cosine * area) : 0.0;
}
