// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "diorama/math.h"

namespace diorama {

/// Paths that advance together.
inline constexpr std::size_t kBatch = 64;

/// One number per path of a batch. Loops over whole steps of such arrays become vector code: what
/// lies behind the last path is computed as well, and ignored.
struct alignas(64) BatchFloats : std::array<float, kBatch> {};
struct alignas(64) BatchInts : std::array<std::int32_t, kBatch> {};

struct BatchVectors {
  BatchFloats x{}, y{}, z{};

  Vec3f at(std::size_t i) const { return {x[i], y[i], z[i]}; }
  void set(std::size_t i, const Vec3f& v) {
    x[i] = v.x();
    y[i] = v.y();
    z[i] = v.z();
  }
};

/// The next multiple of the widest vector's length.
inline std::size_t whole_steps(std::size_t count) { return (count + 7) / 8 * 8; }

/// Without a branch, which would keep loops from becoming vector code.
inline Vec3f select(bool condition, const Vec3f& a, const Vec3f& b) {
  return {condition ? a.x() : b.x(), condition ? a.y() : b.y(), condition ? a.z() : b.z()};
}

}  // namespace diorama
