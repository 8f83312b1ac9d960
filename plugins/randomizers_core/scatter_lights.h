// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Gives sphere, rect and disk lights a random place in a box at the working area, a random colour
/// and a random strength; other lights among the nodes are left alone.
class ScatterLights final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Lights/*";
    Vec3 offset_min{-2.0, -2.0, 1.0};
    Vec3 offset_max{2.0, 2.0, 3.0};
    Vec3 color_min{0.1, 0.1, 0.1};
    Vec3 color_max{0.9, 0.9, 0.9};
    Range intensity{0.5, 2.5};
    Range radius_m{0.0, 0.0};

    void visit(ParamVisitor& v);
  };

  ScatterLights(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
