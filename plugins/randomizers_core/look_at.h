// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Turns each node, where it stands, towards a random target (the centre of its box) or, without
/// targets, towards the working area. Place and scale stay.
class LookAt final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Cameras/*";
    std::string targets = "/Assets/*";
    Distribution offset = Distribution(Vec3(0.0, 0.0, 0.0));
    Distribution roll_deg = 0.0;
    std::string axis = "-z";

    void visit(ParamVisitor& v);
  };

  LookAt(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
