// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Gives rigid bodies a velocity towards the centre of the working area, so that what drifts about
/// gathers there. How they turn stays.
class PullTogether final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    Distribution strength = Range{0.1, 1.0};

    void visit(ParamVisitor& v);
  };

  PullTogether(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
