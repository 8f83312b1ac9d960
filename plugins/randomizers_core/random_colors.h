// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Paints every mesh among the nodes in one random colour. Each node gets a material of its own,
/// the mesh stays shared.
class RandomColors final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/**";
    Distribution color = Distribution::between(Vec3::Zero(), Vec3::Ones());

    void visit(ParamVisitor& v);
  };

  RandomColors(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
