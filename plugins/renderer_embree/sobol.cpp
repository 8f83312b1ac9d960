// SPDX-License-Identifier: Apache-2.0
#include "sobol.h"

namespace diorama {

SobolTable::SobolTable() {
  // Direction numbers of the second dimension, which belongs to the polynomial x + 1.
  std::array<std::uint32_t, kBits> direction;
  for (std::uint32_t bit = 0; bit < kBits; ++bit) {
    direction[bit] = bit == 0 ? 0x8000u : direction[bit - 1] ^ (direction[bit - 1] >> 1);
  }
  for (std::uint32_t reversed = 0; reversed < kSize; ++reversed) {
    std::uint32_t point = 0;
    for (std::uint32_t bit = 0; bit < kBits; ++bit) {
      if ((reversed >> (kBits - 1 - bit) & 1u) != 0) point ^= direction[bit];
    }
    second_[reversed] = std::uint16_t(point);
  }
}

}  // namespace diorama
