// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Draws the velocities of rigid bodies; the next steps of the simulation start with them. With a
/// box only those whose own box (along the world's axes) meets it: called after each step, that is
/// a floor that throws up what comes down.
class RandomVelocities final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::optional<Distribution> velocity =
        Distribution::between(Vec3::Constant(-1.0), Vec3::Constant(1.0));
    std::optional<Distribution> angular_velocity_deg;
    std::vector<double> box_min;
    std::vector<double> box_max;

    void visit(ParamVisitor& v);
  };

  /// Throws Error(Config) when the corners are not those of a box.
  RandomVelocities(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  std::optional<Aabb> box_;  ///< From the working area.
};

}  // namespace diorama
