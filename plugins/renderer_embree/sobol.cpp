// SPDX-License-Identifier: Apache-2.0
#include "sobol.h"

namespace diorama {

SobolTable::SobolTable() {
  // Direction numbers: dimension 1 is the radical inverse, dimension 2 belongs to x + 1.
  std::array<std::uint32_t, kBits> first;
  std::array<std::uint32_t, kBits> second;
  for (std::uint32_t bit = 0; bit < kBits; ++bit) {
    first[bit] = 0x80000000u >> bit;
    second[bit] = bit == 0 ? 0x80000000u : second[bit - 1] ^ (second[bit - 1] >> 1);
  }
  for (std::uint32_t i = 0; i < kSize; ++i) {
    std::array<std::uint32_t, 2> point{0, 0};
    std::uint32_t backwards = 0;
    for (std::uint32_t bit = 0; bit < kBits; ++bit) {
      if (!(i >> bit & 1u)) continue;
      point[0] ^= first[bit];
      point[1] ^= second[bit];
      backwards |= 1u << (kBits - 1 - bit);
    }
    points_[i] = point;
    reversed_[i] = std::uint16_t(backwards);
  }
}

}  // namespace diorama
