// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "diorama/math.h"

namespace diorama {

/// A stream of random numbers: counter based (a keyed 64-bit mix of a running counter), so that a
/// fork depends on the stream's key only, never on how many numbers were drawn. Adding a draw or a
/// randomizer does not move any other stream. Same numbers on every platform; cheap to copy (a copy
/// repeats the numbers that the original would give).
class DIORAMA_SDK_API Rng {
 public:
  explicit Rng(std::uint64_t seed);

  Rng fork(std::string_view name) const;
  Rng fork(std::uint64_t index) const;

  std::uint64_t bits();                  ///< 64 uniform bits.
  double uniform();                      ///< In [0, 1), 53 bits.
  double uniform(double lo, double hi);  ///< In [lo, hi); lo when both are equal.
  std::size_t index(std::size_t count);  ///< In [0, count), without bias; count > 0.
  bool chance(double probability);
  double normal();  ///< Mean 0, standard deviation 1 (Box-Muller, two draws).
  Vec3 uniform_in(const Aabb& box);
  Vec3 unit_vector();       ///< Uniform on the sphere.
  Quat uniform_rotation();  ///< Uniform on SO(3) (Shoemake 1992).

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

/// FNV-1a, 64 bit. The project's one hash for names: stable over runs, platforms and releases.
DIORAMA_SDK_API std::uint64_t stable_hash(std::string_view text);

}  // namespace diorama
