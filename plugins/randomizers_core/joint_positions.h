// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Opens doors and drawers: draws the positions of joints within their limits and moves what they
/// hold, and all that hangs on it.
class JointPositions final : public Randomizer {
 public:
  struct Params {
    std::vector<std::string> joints{"/**"};
    Distribution moved_chance = 1.0;
    Distribution share = Range{0.0, 1.0};
    std::optional<Distribution> angle_deg;
    std::optional<Distribution> distance_m;

    void visit(ParamVisitor& v);
  };

  JointPositions(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
