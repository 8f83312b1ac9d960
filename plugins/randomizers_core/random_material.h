// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Draws roughness and metalness anew for every material of every mesh among the nodes; colours and
/// other inputs stay, textures of the two go.
class RandomMaterial final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/**";
    Range roughness{0.1, 0.9};
    Range metallic{0.0, 0.0};

    void visit(ParamVisitor& v);
  };

  RandomMaterial(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
