// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Shows each node with a given probability and hides it otherwise. Hidden nodes still collide.
class RandomVisibility final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/*/*";
    Distribution visible_chance = 0.5;

    void visit(ParamVisitor& v);
  };

  RandomVisibility(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
