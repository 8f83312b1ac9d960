// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Gives nodes a random place in a box whose corners are offsets from the working area along the
/// world's axes, a random rotation and an even random scale. The node's own pose is replaced.
class ScatterPoses final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    Vec3 offset_min{-0.5, -0.5, 1.0};
    Vec3 offset_max{0.5, 0.5, 1.5};
    std::string rotation = "uniform";
    Range rotation_deg{0.0, 360.0};
    Range scale{1.0, 1.0};

    void visit(ParamVisitor& v);
  };

  ScatterPoses(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Quat draw_rotation(Rng& rng) const;

  Params params_;
};

}  // namespace diorama
