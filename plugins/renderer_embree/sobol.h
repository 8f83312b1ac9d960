// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "diorama/math.h"

namespace diorama {

/// Counter-free mix of 64 bits (the finaliser of SplitMix64).
inline std::uint64_t mix_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// The first 4096 points of the two-dimensional Sobol sequence, by the reversed bits of their
/// index: these are the first coordinate already, so only the second is stored.
class SobolTable {
 public:
  static constexpr std::uint32_t kBits = 12;
  static constexpr std::uint32_t kSize = 1u << kBits;

  SobolTable();
  /// The upper 16 bits of the second coordinate of the point whose first is `reversed` / kSize.
  std::uint32_t second(std::uint32_t reversed) const { return second_[reversed]; }

 private:
  std::array<std::uint16_t, kSize> second_;
};

/// The random numbers of one light path: pairs of dimensions of an Owen-shuffled Sobol sequence, a
/// pair for every purpose. Equal (seed, pixel, index) give equal numbers.
class PathSampler {
 public:
  PathSampler(const SobolTable& table, std::uint64_t seed, int x, int y, std::uint32_t index)
      : PathSampler(table, pixel_key(seed, x, y, index), index) {}
  /// With the key of the pixel at hand.
  PathSampler(const SobolTable& table, std::uint32_t key, std::uint32_t index)
      : table_(table), key_(key), reversed_(reversed(index)) {}

  /// The same for SobolTable::kSize indices in a row.
  static std::uint32_t pixel_key(std::uint64_t seed, int x, int y, std::uint32_t index) {
    const std::uint64_t pixel = (std::uint64_t(std::uint32_t(x)) << 32) ^ std::uint32_t(y);
    const std::uint64_t round = std::uint64_t(index >> SobolTable::kBits) << 40;
    return std::uint32_t(mix_bits(seed ^ mix_bits(pixel ^ 0x9E3779B97F4A7C15u) ^ round));
  }

  /// Two numbers in [0, 1), well spread over the samples of the pixel.
  Vec2f next() { return next_pairs<1>()[0]; }

  /// Several pairs at once: the loops below become vector code.
  template <std::size_t Count>
  std::array<Vec2f, Count> next_pairs() {
    std::array<std::uint32_t, Count> keys;
    std::array<std::uint32_t, Count> shuffled;
    for (std::size_t i = 0; i < Count; ++i) {
      keys[i] = hashed(key_ + (dimension_ + std::uint32_t(i)) * 0x9E3779B9u);
    }
    for (std::size_t i = 0; i < Count; ++i) shuffled[i] = shuffle(reversed_, keys[i]);
    dimension_ += std::uint32_t(Count);
    std::array<Vec2f, Count> pairs;
    for (std::size_t i = 0; i < Count; ++i) {
      const std::uint32_t scramble = keys[i] * 0x9E3779B1u;
      const std::uint32_t first = shuffled[i] << (32 - SobolTable::kBits);
      const std::uint32_t second = table_.second(shuffled[i]) << 16;
      pairs[i] = {fraction(first ^ scramble), fraction(second ^ (scramble >> 16 | scramble << 16))};
    }
    return pairs;
  }

 private:
  static float fraction(std::uint32_t bits) { return float(std::int32_t(bits >> 8)) * 0x1p-24f; }

  /// A good 32-bit hash (found by search, Wellons 2018).
  static std::uint32_t hashed(std::uint32_t x) {
    x = (x ^ (x >> 16)) * 0x21F0AAADu;
    x = (x ^ (x >> 15)) * 0xD35A2D97u;
    return x ^ (x >> 15);
  }

  static std::uint32_t reversed(std::uint32_t index) {
    std::uint32_t x = index & (SobolTable::kSize - 1);
    x = (x & 0x555u) << 1 | (x >> 1 & 0x555u);
    x = (x & 0x333u) << 2 | (x >> 2 & 0x333u);
    return (x & 0x00Fu) << 8 | (x & 0x0F0u) | x >> 8;  // groups of four
  }

  // A nested uniform shuffle: each bit of the index is flipped by a hash of the bits above it. The
  // multiplications of Laine and Karras (2011) carry upwards, hence the reversed index.
  static std::uint32_t shuffle(std::uint32_t x, std::uint32_t seed) {
    x += seed;
    x ^= x * 0x6C50B47Cu;
    x ^= x * 0xB82F1E52u;
    x ^= x * 0xC7AFE638u;
    x ^= x * 0x8D22F6E6u;
    return x & (SobolTable::kSize - 1);
  }

  const SobolTable& table_;
  std::uint32_t key_;
  std::uint32_t dimension_ = 1;
  std::uint32_t reversed_;
};

}  // namespace diorama
