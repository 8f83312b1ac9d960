// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "diorama/math.h"
#include "diorama/rng.h"

namespace diorama {

/// Poses between keys: cubic splines through the places (Catmull and Rom's, for any times), turns
/// by cubic splines on the sphere of rotations (squad). Before the first and behind the last key it
/// stands still.
class KeyCurve {
 public:
  struct Key {
    double time_s = 0.0;
    Vec3 position = Vec3::Zero();
    Quat rotation = Quat::Identity();
  };

  /// At least one, times ascending.
  explicit KeyCurve(std::vector<Key> keys);
  Affine pose(double time_s) const;

 private:
  Vec3 tangent(std::size_t key) const;
  Quat control(std::size_t key) const;

  std::vector<Key> keys_;
};

/// A way without corners, walked at one speed: quadratic splines that touch the middle of each line
/// between two places and lie inside the corner that two lines make.
class WalkCurve {
 public:
  /// At least one place.
  explicit WalkCurve(const std::vector<Vec3>& places);
  double length_m() const { return lengths_.empty() ? 0.0 : lengths_.back(); }
  Vec3 place(double distance_m) const;
  /// Unit, level as the way is; along x for a way without length.
  Vec3 direction(double distance_m) const;

  /// Points along the corner from the middle of ab to the middle of bc, both included.
  static std::vector<Vec3> corner(const Vec3& a, const Vec3& b, const Vec3& c);

 private:
  std::vector<Vec3> points_;
  std::vector<double> lengths_;  ///< Up to each point.
};

/// How a hand shakes: sums of waves up to a frequency, with phases of their own on every axis.
class HandShake {
 public:
  HandShake() = default;
  /// Root mean squares per axis: metres, radians.
  HandShake(double position_m, double angle_rad, double frequency_hz, Rng rng);
  /// In the space of what is held.
  Affine at(double time_s) const;
  /// How far off its path it carries what is held in any of so many frames, in metres.
  double reach_m(int frames, double fps) const;

 private:
  struct Wave {
    double frequency_hz = 0.0;
    double phase = 0.0;
  };
  static constexpr std::size_t kWaves = 8;
  double sum(std::size_t axis, double time_s) const;

  double position_m_ = 0.0;
  double angle_rad_ = 0.0;
  std::array<std::array<Wave, kWaves>, 6> waves_{};
};

}  // namespace diorama
