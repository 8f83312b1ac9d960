// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Gives sphere, rect and disk lights a random place near the working area, a random colour and a
/// random strength; other lights among the nodes are left alone.
///
/// A light next to a surface burns it white, and one behind a wall lights nothing. Places are drawn
/// again while anything visible is nearer to the light than `clearance_m`, or a part of the
/// environment stands between it and the air above the working area. When no place within
/// `max_tries` is free, the one farthest from everything is taken, in front of walls if possible.
class ScatterLights final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Lights/*";
    Distribution offset = Distribution::between({-2.0, -2.0, 1.0}, {2.0, 2.0, 3.0});
    Distribution color = Distribution::between(Vec3::Constant(0.1), Vec3::Constant(0.9));
    Distribution intensity = Range{500.0, 2500.0};
    std::optional<Distribution> temperature_k;
    std::optional<Distribution> radius_m;
    double clearance_m = 0.3;
    int max_tries = 100;

    void visit(ParamVisitor& v);
  };

  ScatterLights(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
