// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
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

/// In [0, 1), by the upper bits.
inline float unit_fraction(std::uint64_t bits) { return float(bits >> 40) * 0x1p-24f; }

/// A good 32-bit hash (found by search, Wellons 2018).
inline std::uint32_t hashed_bits(std::uint32_t x) {
  x = (x ^ (x >> 16)) * 0x21F0AAADu;
  x = (x ^ (x >> 15)) * 0xD35A2D97u;
  return x ^ (x >> 15);
}

/// How the pixels of a picture share one Sobol sequence: each takes a run of it as long as the
/// samples wanted (rounded up to a power of two), in the order of a Z-shaped curve. Neighbours then
/// complete each other: their errors differ and cancel when the picture is blurred, by an eye or by
/// a denoiser (Ahmed and Wonka 2020).
class SampleOrder {
 public:
  SampleOrder(std::uint64_t seed, std::uint32_t samples)
      : seed_(seed),
        bits_(std::min(int(std::bit_width(std::max(samples, 1u) - 1u)), kSampleBits)) {}

  /// Of the samples of one round, which share a sequence.
  int sample_bits() const { return bits_; }

  struct Place {
    std::uint32_t key = 0;    ///< Of the sequence.
    std::uint32_t index = 0;  ///< In it.
  };
  Place place(int x, int y, std::uint32_t sample) const {
    const auto u = std::uint32_t(x);
    const auto v = std::uint32_t(y);
    const std::uint64_t tile = std::uint64_t(u >> kTileBits) << 32 | (v >> kTileBits);
    const std::uint64_t round = std::uint64_t(sample >> bits_) << 20;
    const std::uint32_t pixel = spread(u & kTileMask) | spread(v & kTileMask) << 1;
    return {std::uint32_t(mix_bits(seed_ ^ mix_bits(tile ^ round ^ 0x9E3779B97F4A7C15u))),
            pixel << bits_ | (sample & ((1u << bits_) - 1u))};
  }

 private:
  static constexpr int kTileBits = 10;  // the side of a square of pixels with its own sequence
  static constexpr std::uint32_t kTileMask = (1u << kTileBits) - 1u;
  static constexpr int kSampleBits = 32 - 2 * kTileBits;

  /// The lower ten bits with gaps between them.
  static std::uint32_t spread(std::uint32_t x) {
    x = (x | x << 8) & 0x00FF00FFu;
    x = (x | x << 4) & 0x0F0F0F0Fu;
    x = (x | x << 2) & 0x33333333u;
    return (x | x << 1) & 0x55555555u;
  }

  std::uint64_t seed_;
  int bits_;
};

/// The random numbers of one light path: pairs of dimensions of an Owen-shuffled Sobol sequence, a
/// pair for every purpose. Equal places give equal numbers.
class PathSampler {
 public:
  explicit PathSampler(const SampleOrder::Place& place)
      : key_(place.key), reversed_(reversed(place.index)) {}

  /// Two numbers in [0, 1), well spread over the samples of the pixel and of its neighbours.
  Vec2f next() { return pair(take(1), reversed_); }

  /// For loops over many samplers: pair() of both is what next() returns. Takes `pairs` at once.
  std::uint32_t take(std::uint32_t pairs) {
    const std::uint32_t first = key_ + dimension_ * kKeyStep;
    dimension_ += pairs;
    return first;
  }
  std::uint32_t place() const { return reversed_; }
  static Vec2f pair(std::uint32_t key, std::uint32_t place) {
    const std::uint32_t hash = hashed_bits(key);
    const std::uint32_t first = shuffled(place, hash);
    const std::uint32_t scramble = hash * 0x9E3779B1u;
    return {fraction(first ^ scramble),
            fraction(second_coordinate(first) ^ (scramble >> 16 | scramble << 16))};
  }
  /// In [0, 1), by the upper bits; vector code has no unsigned numbers.
  static float fraction(std::uint32_t bits) { return float(std::int32_t(bits >> 8)) * 0x1p-24f; }
  static constexpr std::uint32_t kKeyStep = 0x9E3779B9u;  ///< From a pair's key to the next.

 private:
  /// The bits in reverse order: the first coordinate of a Sobol point by its index.
  static std::uint32_t reversed(std::uint32_t x) {
    x = (x & 0x55555555u) << 1 | (x >> 1 & 0x55555555u);
    x = (x & 0x33333333u) << 2 | (x >> 2 & 0x33333333u);
    x = (x & 0x0F0F0F0Fu) << 4 | (x >> 4 & 0x0F0F0F0Fu);
    return __builtin_bswap32(x);
  }

  /// The second coordinate by the first. Its generator matrix is Pascal's triangle modulo 2, a
  /// product of five sparse matrices.
  static std::uint32_t second_coordinate(std::uint32_t x) {
    x ^= (x & 0x55555555u) << 1;
    x ^= (x & 0x33333333u) << 2;
    x ^= (x & 0x0F0F0F0Fu) << 4;
    x ^= (x & 0x00FF00FFu) << 8;
    return x ^ x << 16;
  }

  // A nested uniform shuffle: each bit of the index is flipped by a hash of the bits above it. The
  // multiplications of Laine and Karras (2011) carry upwards, hence the reversed index.
  static std::uint32_t shuffled(std::uint32_t x, std::uint32_t seed) {
    x += seed;
    x ^= x * 0x6C50B47Cu;
    x ^= x * 0xB82F1E52u;
    x ^= x * 0xC7AFE638u;
    x ^= x * 0x8D22F6E6u;
    return x;
  }

  std::uint32_t key_;
  std::uint32_t dimension_ = 1;
  std::uint32_t reversed_;
};

}  // namespace diorama
