// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "diorama/math.h"

namespace diorama {

/// Paths that advance together.
inline constexpr std::size_t kBatch = 128;

/// One number per path of a batch. Loops over whole steps of such arrays become vector code: what
/// lies behind the last path is computed as well, and ignored.
/// Nothing is set before it is written.
struct alignas(64) BatchFloats : std::array<float, kBatch> {};
struct alignas(64) BatchInts : std::array<std::int32_t, kBatch> {};

struct BatchVectors {
  BatchFloats x, y, z;

  Vec3f at(std::size_t i) const { return {x[i], y[i], z[i]}; }
  void set(std::size_t i, const Vec3f& v) {
    x[i] = v.x();
    y[i] = v.y();
    z[i] = v.z();
  }
};

/// Rays of a batch, side by side.
struct BatchRays {
  std::size_t count = 0;
  BatchVectors origin;
  BatchVectors direction;  ///< Unit.
  BatchFloats t_min, t_max;
  BatchFloats time;  ///< Share of the shutter's window.

  void add(const Vec3f& from, const Vec3f& towards, float begin, float end, float when) {
    origin.set(count, from);
    direction.set(count, towards);
    t_min[count] = begin;
    t_max[count] = end;
    time[count] = when;
    ++count;
  }
};

/// The next multiple of the widest vector's length.
inline std::size_t whole_steps(std::size_t count) {
  return std::min((count + 15) / 16 * 16, kBatch);
}

/// Without a branch, which would keep loops from becoming vector code.
inline Vec3f select(bool condition, const Vec3f& a, const Vec3f& b) {
  return {condition ? a.x() : b.x(), condition ? a.y() : b.y(), condition ? a.z() : b.z()};
}

/// `a` where the mask is -1, `b` where it is 0. For values that are read from memory: compilers
/// would rather branch than read both.
inline float blend(std::int32_t mask, float a, float b) {
  return std::bit_cast<float>((std::bit_cast<std::int32_t>(a) & mask) |
                              (std::bit_cast<std::int32_t>(b) & ~mask));
}
inline Vec3f blend(std::int32_t mask, const Vec3f& a, const Vec3f& b) {
  return {blend(mask, a.x(), b.x()), blend(mask, a.y(), b.y()), blend(mask, a.z(), b.z())};
}

}  // namespace diorama
