// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>

namespace diorama {

/// Eight numbers at once by GCC's vector extension: as wide as the instruction set allows, equal
/// results in all but for fused multiplications.
inline constexpr int kLanes = 8;
using Lanes [[gnu::vector_size(4 * kLanes), gnu::aligned(16)]] = float;

inline Lanes load_lanes(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
inline void store_lanes(const Lanes& lanes, float* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

struct Lanes3 {
  Lanes x{}, y{}, z{};
};

inline Lanes all_lanes(float value) { return Lanes{} + value; }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return a < b ? a : b; }
inline Lanes larger(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
inline Lanes magnitude(const Lanes& a) { return larger(a, -a); }

}  // namespace diorama
