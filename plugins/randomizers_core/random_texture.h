// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "box_mapping.h"
#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"
#include "texture_choice.h"

namespace diorama {

/// Puts a random picture on every mesh among the nodes, as the colour of all its materials. Meshes
/// without uv coordinates get some by box mapping.
class RandomTexture final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/**";
    TextDistribution textures;
    Distribution repeat = 1.0;
    Distribution rotation_deg = 0.0;
    double picture_m = 0.3;

    void visit(ParamVisitor& v);
  };

  RandomTexture(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  TextureChoice textures_;
  BoxMapping box_mapping_;
};

}  // namespace diorama
