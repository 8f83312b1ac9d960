// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "diorama/math.h"

namespace diorama {

/// Counter-free mix of 64 bits (the finaliser of SplitMix64).
inline std::uint64_t mix_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// The first 4096 points of the two-dimensional Sobol sequence as 32-bit fractions.
class SobolTable {
 public:
  static constexpr std::uint32_t kBits = 12;
  static constexpr std::uint32_t kSize = 1u << kBits;

  SobolTable();
  const std::array<std::uint32_t, 2>& operator[](std::uint32_t index) const {
    return points_[index];
  }
  /// The lowest kBits bits of an index in reverse order.
  std::uint32_t reversed(std::uint32_t index) const { return reversed_[index]; }

 private:
  std::array<std::array<std::uint32_t, 2>, kSize> points_;
  std::array<std::uint16_t, kSize> reversed_;
};

/// The random numbers of one light path: pairs of dimensions of an Owen-shuffled Sobol sequence, a
/// pair for every purpose. Equal (seed, pixel, index) give equal numbers.
class PathSampler {
 public:
  PathSampler(const SobolTable& table, std::uint64_t seed, int x, int y, std::uint32_t index)
      : table_(table),
        key_(mix_bits(seed ^
                      mix_bits((std::uint64_t(std::uint32_t(x)) << 32) ^ std::uint32_t(y) ^
                               0x9E3779B97F4A7C15u) ^
                      (std::uint64_t(index >> SobolTable::kBits) << 40))),
        index_(index & (SobolTable::kSize - 1)) {}

  /// Two numbers in [0, 1), well spread over the samples of the pixel.
  Vec2f next() {
    const std::uint64_t key = mix_bits(key_ + ++dimension_ * 0x9E3779B97F4A7C15u);
    const auto& point = table_[shuffled(std::uint32_t(key))];
    const auto scramble = std::uint32_t(key >> 32);
    return {unit(point[0] ^ scramble), unit(point[1] ^ (scramble * 0x9E3779B1u ^ 0x85EBCA6Bu))};
  }

 private:
  static float unit(std::uint32_t bits) { return float(bits >> 8) * 0x1p-24f; }

  // A nested uniform shuffle of the index: each bit is flipped by a hash of the bits above it. The
  // multiplications of Laine and Karras (2011) carry upwards, hence the reversal.
  std::uint32_t shuffled(std::uint32_t seed) const {
    std::uint32_t x = table_.reversed(index_);
    x += seed;
    x ^= x * 0x6C50B47Cu;
    x ^= x * 0xB82F1E52u;
    x ^= x * 0xC7AFE638u;
    x ^= x * 0x8D22F6E6u;
    return table_.reversed(x & (SobolTable::kSize - 1));
  }

  const SobolTable& table_;
  std::uint64_t key_;
  std::uint64_t dimension_ = 0;
  std::uint32_t index_;
};

}  // namespace diorama
