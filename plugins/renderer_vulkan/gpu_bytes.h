// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// Tables that go to the device together; each begins at a multiple of 16 bytes.
class GpuBytes {
 public:
  /// Where the values begin.
  template <class Value>
  std::size_t add(std::span<const Value> values) {
    const std::size_t begin = (bytes_.size() + 15) / 16 * 16;
    bytes_.resize(begin + values.size_bytes());
    if (!values.empty()) {
      std::memcpy(&bytes_[begin], static_cast<const void*>(values.data()), values.size_bytes());
    }
    return begin;
  }
  template <class Value>
  std::size_t add(const std::vector<Value>& values) {
    return add(std::span<const Value>(values));
  }
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// A triangle as kernels read it: three columns of four numbers.
struct TriangleColumns {
  std::array<float, 4> corner;
  std::array<float, 4> ab;
  std::array<float, 4> ac;
};
inline TriangleColumns columns_of(const Vec3f& a, std::uint32_t number, const Vec3f& ab,
                                  float end_area, const Vec3f& ac) {
  return {{a.x(), a.y(), a.z(), std::bit_cast<float>(number)},
          {ab.x(), ab.y(), ab.z(), end_area},
          {ac.x(), ac.y(), ac.z(), 0.0f}};
}

inline void add_floats(std::vector<std::uint32_t>& words, std::span<const float> values) {
  for (const float value : values) words.push_back(std::bit_cast<std::uint32_t>(value));
}

}  // namespace diorama
