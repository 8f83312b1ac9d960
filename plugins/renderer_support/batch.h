// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

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

/// What a ray that goes on through a surface does not meet again; -1: it meets everything.
struct LeftTriangle {
  std::int32_t instance = -1;
  std::int32_t triangle = -1;
};

/// Rays of a batch, side by side.
struct BatchRays {
  std::size_t count = 0;
  bool is_coherent = false;  ///< Neighbours go nearly the same way.
  BatchVectors origin;
  BatchVectors direction;  ///< Unit.
  BatchFloats t_min, t_max;
  BatchFloats time;  ///< Share of the shutter's window.
  BatchInts left_instance, left_triangle;

  void add(const Vec3f& from, const Vec3f& towards, float begin, float end, float when,
           const LeftTriangle& left = {}) {
    origin.set(count, from);
    direction.set(count, towards);
    t_min[count] = begin;
    t_max[count] = end;
    time[count] = when;
    left_instance[count] = left.instance;
    left_triangle[count] = left.triangle;
    ++count;
  }
};

/// The next multiple of the widest vector's length.
inline std::size_t whole_steps(std::size_t count) {
  return std::min((count + 15) / 16 * 16, kBatch);
}

/// For each entry what the table holds at its index. By way of a local array, which compilers know
/// not to overlap with the table: they then make vector code of it.
template <class Value, class Values>
inline void gather(const std::vector<Value>& table, const BatchInts& indices, std::size_t size,
                   Values& values) {
  const Value* from = table.data();
  Values found;
  for (std::size_t i = 0; i < size; ++i) found[i] = from[indices[i]];
  std::copy_n(found.begin(), size, values.begin());
}

}  // namespace diorama
