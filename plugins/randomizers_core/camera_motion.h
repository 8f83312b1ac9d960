// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Draws the velocities of cameras. They stay where they are: only pictures with an exposure or
/// readout time show the motion.
class CameraMotion final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Cameras/*";
    Distribution velocity = Distribution::between(Vec3::Constant(-0.2), Vec3::Constant(0.2));
    Distribution angular_velocity_deg =
        Distribution::between(Vec3::Constant(-10.0), Vec3::Constant(10.0));
    std::optional<Distribution> exposure_time_s;

    void visit(ParamVisitor& v);
  };

  CameraMotion(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
