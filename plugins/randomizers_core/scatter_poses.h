// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Gives nodes a random place, as an offset from the working area along the world's axes, a random
/// rotation and a random scale. The node's own pose is replaced.
///
/// With `avoid_overlap` the place is drawn again while the node's box (along its own axes) would
/// come too near to an obstacle or to a node placed before it; rotation and scale stay as first
/// drawn, so that none is rarer than the job says. When no place within `max_tries` is free, the
/// first stands.
class ScatterPoses final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    Distribution offset = Distribution::between({-0.5, -0.5, 1.0}, {0.5, 0.5, 1.5});
    std::string rotation = "uniform";
    Distribution rotation_deg = Range{0.0, 360.0};
    Distribution scale = 1.0;
    bool avoid_overlap = true;
    std::vector<std::string> obstacles{"/**"};
    double clearance_m = 0.01;
    int max_tries = 100;

    void visit(ParamVisitor& v);
  };

  ScatterPoses(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Quat draw_rotation(NodeDraws& draws) const;

  Params params_;
  Host& host_;
};

}  // namespace diorama
