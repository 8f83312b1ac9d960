// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "diorama/math.h"

/// Maps from the unit square to directions and points, with their densities. All directions are
/// unit length; "local" means z along the surface normal.
namespace diorama {

inline constexpr float kPiF = std::numbers::pi_v<float>;
inline constexpr float kInfinite = std::numeric_limits<float>::infinity();

inline float luminance(const Vec3f& rgb) {
  return 0.2126f * rgb.x() + 0.7152f * rgb.y() + 0.0722f * rgb.z();
}

/// `condition ? a : b`, in a form that compilers never turn into a branch, which would keep loops
/// around it from becoming vector code.
inline float select(bool condition, float a, float b) {
  const std::int32_t mask = -std::int32_t(condition);
  return std::bit_cast<float>((std::bit_cast<std::int32_t>(a) & mask) |
                              (std::bit_cast<std::int32_t>(b) & ~mask));
}

inline Vec3f select(bool condition, const Vec3f& a, const Vec3f& b) {
  return {select(condition, a.x(), b.x()), select(condition, a.y(), b.y()),
          select(condition, a.z(), b.z())};
}

/// v at unit length; v is not zero. One division instead of three.
inline Vec3f unit(const Vec3f& v) { return v * (1.0f / std::sqrt(v.squaredNorm())); }

/// Right-handed orthonormal axes with z = n.
struct Basis {
  Vec3f x;
  Vec3f y;
  Vec3f z;

  Vec3f to_local(const Vec3f& v) const { return {x.dot(v), y.dot(v), z.dot(v)}; }
  Vec3f to_world(const Vec3f& v) const { return x * v.x() + y * v.y() + z * v.z(); }
};

/// Duff et al., "Building an orthonormal basis, revisited", 2017.
inline Basis basis_around(const Vec3f& n) {
  const float sign = std::copysign(1.0f, n.z());
  const float a = -1.0f / (sign + n.z());
  const float b = n.x() * n.y() * a;
  return {{1.0f + sign * n.x() * n.x() * a, sign * b, -sign * n.x()},
          {b, sign + n.y() * n.y() * a, -n.y()},
          n};
}

/// Two numbers without an address: unlike small vectors, they never keep a loop from becoming
/// vector code.
struct CosSin {
  float cosine = 0.0f;
  float sine = 0.0f;
};

/// Of an angle within a quarter turn around zero, to 1e-6; the library's functions cost many times
/// as much.
inline CosSin cos_sin_small(float angle) {
  const float a2 = angle * angle;
  const float cosine =
      1.0f + a2 * (-0.5f + a2 * (1.0f / 24.0f + a2 * (-1.0f / 720.0f + a2 * (1.0f / 40320.0f))));
  const float sine =
      angle * (1.0f + a2 * (-1.0f / 6.0f + a2 * (1.0f / 120.0f + a2 * (-1.0f / 5040.0f))));
  return {cosine, sine};
}

/// Of an angle of `turns` in [0, 1].
inline CosSin unit_circle(float turns) {
  // The nearest whole number by what a large one leaves of its fraction: conversions back and forth
  // keep loops from becoming vector code.
  constexpr float kRounds = 12582912.0f;  // 1.5 * 2^23
  const float shifted = turns * 4.0f + kRounds;
  const auto quarter = std::bit_cast<std::uint32_t>(shifted);
  const CosSin p = cos_sin_small((turns - 0.25f * (shifted - kRounds)) * (2.0f * kPiF));
  const bool is_odd = (quarter & 1) != 0;
  const float cosine = select(is_odd, -p.sine, p.cosine);
  const float sine = select(is_odd, p.cosine, p.sine);
  const float sign = select((quarter & 2) != 0, -1.0f, 1.0f);
  return {sign * cosine, sign * sine};
}

/// Uniform on the unit disk, keeping neighbours together (Shirley and Chiu 1997).
inline Vec2f disk_from_square(const Vec2f& u) {
  const float a = 2.0f * u.x() - 1.0f;
  const float b = 2.0f * u.y() - 1.0f;
  const bool is_wide = std::abs(a) > std::abs(b);
  const float r = select(is_wide, a, b);
  const float other = select(is_wide, b, a);
  const CosSin p = cos_sin_small(0.25f * kPiF * (other / select(r == 0.0f, 1.0f, r)));
  const float along = r * p.cosine;
  const float across = r * p.sine;
  return {select(is_wide, along, across), select(is_wide, across, along)};
}

/// Density cos(theta) / pi.
inline Vec3f cosine_hemisphere(const Vec2f& u) {
  const Vec2f d = disk_from_square(u);
  return {d.x(), d.y(), std::sqrt(std::max(0.0f, 1.0f - d.squaredNorm()))};
}

/// Uniform in the cone around z; `one_minus_cos` of its half angle, exact for narrow cones. Density
/// 1 / (2 pi one_minus_cos).
inline Vec3f uniform_cone(const Vec2f& u, float one_minus_cos) {
  const float h = u.x() * one_minus_cos;  // 1 - cos(theta)
  const float sin_theta = std::sqrt(std::max(0.0f, h * (2.0f - h)));
  const CosSin p = unit_circle(u.y());
  return {sin_theta * p.cosine, sin_theta * p.sine, 1.0f - h};
}

inline Vec3f uniform_sphere(const Vec2f& u) { return uniform_cone(u, 2.0f); }

/// The interval of an ascending table, of `count` + 1 borders from 0 to 1, that u in [0, 1) falls
/// into. Counts borders, by vector code: a search by halves waits for memory and guesses wrong at
/// every step, and the tables are short.
inline int interval_of(const float* borders, int count, float u) {
  int passed = 0;
  for (int i = 1; i < count; ++i) passed += borders[i] <= u ? 1 : 0;
  return passed;
}

/// Barycentric weights of the second and third corner, uniform over the triangle.
inline Vec2f triangle_from_square(const Vec2f& u) {
  const float root = std::sqrt(u.x());
  return {root * (1.0f - u.y()), root * u.y()};
}

/// Weight of a sample of density `own` against another technique's finite density (Veach's power
/// heuristic).
inline float mis_weight(float own, float other) {
  const float ratio = other / own;
  return 1.0f / (1.0f + ratio * ratio);
}

}  // namespace diorama
