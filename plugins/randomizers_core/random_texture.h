// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"
#include "texture_choice.h"

namespace diorama {

/// Puts a random picture on every mesh among the nodes, as the colour of all its materials. Meshes
/// without uv coordinates show the picture's lower left pixel only.
class RandomTexture final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/**";
    TextDistribution textures;
    Distribution repeat = 1.0;
    Distribution rotation_deg = 0.0;

    void visit(ParamVisitor& v);
  };

  RandomTexture(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  TextureChoice textures_;
};

}  // namespace diorama
