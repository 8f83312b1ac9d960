// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Changes what nodes are called in one taxonomy.
class RandomLabels final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::string mode = "replace";
    std::string taxonomy = "class";
    TextDistribution labels = TextDistribution({"object"});

    void visit(ParamVisitor& v);
  };

  RandomLabels(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
