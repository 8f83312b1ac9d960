// SPDX-License-Identifier: Apache-2.0
// See sampling.h and sobol.h of renderer_support, whose numbers these are.
const float kPi = 3.14159265358979;

float luminance(vec3 rgb) { return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z; }
float largest(vec3 v) { return max(v.x, max(v.y, v.z)); }
vec3 unit(vec3 v) { return v * (1.0 / sqrt(dot(v, v))); }

mat3 basis_around(vec3 n) {
  const float sign = n.z < 0.0 ? -1.0 : 1.0;
  const float a = -1.0 / (sign + n.z);
  const float b = n.x * n.y * a;
  return mat3(vec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
              vec3(b, sign + n.y * n.y * a, -n.y), n);
}
vec3 to_local(mat3 basis, vec3 v) { return v * basis; }
vec3 to_world(mat3 basis, vec3 v) { return basis * v; }

vec2 cos_sin_small(float angle) {
  const float a2 = angle * angle;
  return vec2(
      1.0 + a2 * (-0.5 + a2 * (1.0 / 24.0 + a2 * (-1.0 / 720.0 + a2 * (1.0 / 40320.0)))),
      angle * (1.0 + a2 * (-1.0 / 6.0 + a2 * (1.0 / 120.0 + a2 * (-1.0 / 5040.0)))));
}

vec2 unit_circle(float turns) {
  const float quarters = floor(turns * 4.0 + 0.5);
  const int quarter = int(quarters);
  const vec2 p = cos_sin_small((turns - 0.25 * quarters) * (2.0 * kPi));
  const vec2 turned = (quarter & 1) != 0 ? vec2(-p.y, p.x) : p;
  return (quarter & 2) != 0 ? -turned : turned;
}

vec2 disk_from_square(vec2 u) {
  const float a = 2.0 * u.x - 1.0;
  const float b = 2.0 * u.y - 1.0;
  const bool is_wide = abs(a) > abs(b);
  const float r = is_wide ? a : b;
  const float other = is_wide ? b : a;
  const vec2 p = r * cos_sin_small(0.25 * kPi * (other / (r == 0.0 ? 1.0 : r)));
  return is_wide ? p : p.yx;
}

vec3 cosine_hemisphere(vec2 u) {
  const vec2 d = disk_from_square(u);
  return vec3(d, sqrt(max(0.0, 1.0 - dot(d, d))));
}

vec3 uniform_cone(vec2 u, float one_minus_cos) {
  const float h = u.x * one_minus_cos;
  const float sin_theta = sqrt(max(0.0, h * (2.0 - h)));
  return vec3(sin_theta * unit_circle(u.y), 1.0 - h);
}

float one_minus_cos_of(float sin2) { return sin2 / (1.0 + sqrt(max(0.0, 1.0 - sin2))); }

float mis_weight(float own, float other) {
  const float ratio = other / own;
  return 1.0 / (1.0 + ratio * ratio);
}

// The sequence.
uint hashed(uint x) {
  x = (x ^ (x >> 16)) * 0x21F0AAADu;
  x = (x ^ (x >> 15)) * 0xD35A2D97u;
  return x ^ (x >> 15);
}
uint second_coordinate(uint x) {
  x ^= (x & 0x55555555u) << 1;
  x ^= (x & 0x33333333u) << 2;
  x ^= (x & 0x0F0F0F0Fu) << 4;
  x ^= (x & 0x00FF00FFu) << 8;
  return x ^ (x << 16);
}
uint shuffled(uint x, uint seed) {
  x += seed;
  x ^= x * 0x6C50B47Cu;
  x ^= x * 0xB82F1E52u;
  x ^= x * 0xC7AFE638u;
  x ^= x * 0x8D22F6E6u;
  return x;
}
float fraction(uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }

struct Sampler {
  uint key;
  uint dimension;
  uint place;
};
vec2 sampler_pair(uint key, uint place) {
  const uint hash = hashed(key);
  const uint first = shuffled(place, hash);
  const uint scramble = hash * 0x9E3779B1u;
  return vec2(fraction(first ^ scramble),
              fraction(second_coordinate(first) ^ (scramble >> 16 | scramble << 16)));
}
vec2 next_pair(inout Sampler s) {
  const uint key = s.key + s.dimension * 0x9E3779B9u;
  ++s.dimension;
  return sampler_pair(key, s.place);
}
uint spread_bits(uint x) {
  x = (x | x << 8) & 0x00FF00FFu;
  x = (x | x << 4) & 0x0F0F0F0Fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}
