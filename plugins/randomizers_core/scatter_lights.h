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
class ScatterLights final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Lights/*";
    Distribution offset = Distribution::between({-2.0, -2.0, 1.0}, {2.0, 2.0, 3.0});
    Distribution color = Distribution::between(Vec3::Constant(0.1), Vec3::Constant(0.9));
    Distribution intensity = Range{500.0, 2500.0};
    std::optional<Distribution> radius_m;

    void visit(ParamVisitor& v);
  };

  ScatterLights(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
