// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Gives nodes a random place, as an offset from the working area along the world's axes, a random
/// rotation and a random scale. The node's own pose is replaced.
class ScatterPoses final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    Distribution offset = Distribution::between({-0.5, -0.5, 1.0}, {0.5, 0.5, 1.5});
    std::string rotation = "uniform";
    Distribution rotation_deg = Range{0.0, 360.0};
    Distribution scale = 1.0;

    void visit(ParamVisitor& v);
  };

  ScatterPoses(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Quat draw_rotation(NodeDraws& draws) const;

  Params params_;
};

}  // namespace diorama
