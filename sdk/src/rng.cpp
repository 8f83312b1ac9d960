// SPDX-License-Identifier: Apache-2.0
#include "diorama/rng.h"

#include <cassert>
#include <cmath>

namespace diorama {

namespace {

// 2^64 divided by the golden ratio, odd: successive multiples spread over all 64 bits.
constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ull;
// Keep name forks, index forks and seeds apart: fork("") differs from fork(0) and from a seed.
constexpr std::uint64_t kSeedTag = 0x64696f72616d6101ull;
constexpr std::uint64_t kNameTag = 0x64696f72616d6102ull;
constexpr std::uint64_t kIndexTag = 0x64696f72616d6103ull;

/// A bijection of 64 bits with full avalanche: David Stafford's "Mix13", the finaliser of
/// SplitMix64 (Steele, Lea, Flood 2014).
constexpr std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

constexpr std::uint64_t derived(std::uint64_t key, std::uint64_t tag, std::uint64_t what) {
  return mix(mix(key ^ tag) + mix(what + kGolden));
}

}  // namespace

Rng::Rng(std::uint64_t seed) : key_(derived(0, kSeedTag, seed)) {}

Rng Rng::fork(std::string_view name) const {
  Rng child(0);
  child.key_ = derived(key_, kNameTag, stable_hash(name));
  return child;
}

Rng Rng::fork(std::uint64_t index) const {
  Rng child(0);
  child.key_ = derived(key_, kIndexTag, index);
  return child;
}

// Two rounds, with the key between them: plain SplitMix64 (one round of key + n * golden) would let
// two streams run through the same numbers when their keys differ by a multiple of the constant.
std::uint64_t Rng::bits() { return mix(key_ ^ mix(++counter_ * kGolden)); }

double Rng::uniform() { return double(bits() >> 11) * 0x1p-53; }

double Rng::uniform(double lo, double hi) {
  assert(lo <= hi);
  const double value = lo + (hi - lo) * uniform();
  // Rounding may reach hi.
  return value < hi || lo == hi ? value : std::nextafter(hi, lo);
}

std::size_t Rng::index(std::size_t count) {
  assert(count > 0);
  // The lowest 2^64 mod count values are refused, what is left is a multiple of count.
  const std::uint64_t refused = (0 - std::uint64_t(count)) % count;
  std::uint64_t drawn = bits();
  while (drawn < refused) drawn = bits();
  return std::size_t(drawn % count);
}

bool Rng::chance(double probability) { return uniform() < probability; }

double Rng::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - u is never 0
  return radius * std::cos(2.0 * kPi * uniform());
}

Vec3 Rng::uniform_in(const Aabb& box) {
  assert(!box.is_empty());
  const double x = uniform(box.min.x(), box.max.x());
  const double y = uniform(box.min.y(), box.max.y());
  const double z = uniform(box.min.z(), box.max.z());
  return {x, y, z};
}

Vec3 Rng::unit_vector() {
  const double z = 2.0 * uniform() - 1.0;
  const double angle = 2.0 * kPi * uniform();
  const double radius = std::sqrt(1.0 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

Quat Rng::uniform_rotation() {
  const double share = uniform();
  const double first = 2.0 * kPi * uniform();
  const double second = 2.0 * kPi * uniform();
  const double a = std::sqrt(1.0 - share);
  const double b = std::sqrt(share);
  return {b * std::cos(second), a * std::sin(first), a * std::cos(first), b * std::sin(second)};
}

std::uint64_t stable_hash(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : text) hash = (hash ^ std::uint8_t(c)) * 0x100000001b3ull;
  return hash;
}

}  // namespace diorama
