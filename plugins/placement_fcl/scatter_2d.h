// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "free_placement.h"

namespace diorama {

/// Sets nodes onto the upward faces of other nodes, evenly by area: the middle of the underside of
/// the node's box comes to the drawn point. Rotation and scale stay. Without such faces a warning
/// is given, and nothing moves.
class Scatter2d final : public Randomizer {
 public:
  struct Params {
    PlacementParams placement;
    std::string surfaces = "/Environment/**";
    double max_slope_deg = 20.0;
    Distribution gap_m = 0.002;

    void visit(ParamVisitor& v);
  };

  Scatter2d(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama
