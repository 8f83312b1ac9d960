// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace diorama {

/// Eight numbers at once by GCC's vector extension: as wide as the instruction set allows, equal
/// results in all but for fused multiplications.
inline constexpr int kLanes = 8;
using Lanes [[gnu::vector_size(4 * kLanes), gnu::aligned(16)]] = float;

/// The same anywhere in memory.
using LooseLanes [[gnu::vector_size(4 * kLanes), gnu::aligned(4), gnu::may_alias]] = float;

inline Lanes load_lanes(const float* from) { return *reinterpret_cast<const LooseLanes*>(from); }
inline void store_lanes(const Lanes& lanes, float* to) {
  *reinterpret_cast<LooseLanes*>(to) = lanes;
}

struct Lanes3 {
  Lanes x{}, y{}, z{};
};

inline Lanes all_lanes(float value) { return Lanes{} + value; }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return a < b ? a : b; }
inline Lanes larger(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
inline Lanes magnitude(const Lanes& a) {
  using Bits [[gnu::vector_size(4 * kLanes)]] = std::int32_t;
  return Lanes(Bits(a) & 0x7FFFFFFF);
}
inline Lanes square_roots(const Lanes& a) {
  Lanes roots;
  for (int i = 0; i < kLanes; ++i) roots[i] = __builtin_sqrtf(a[i]);
  return roots;
}
inline Lanes dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

}  // namespace diorama
