// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"
#include "texture_choice.h"

namespace diorama {

/// Picks a sky for dome lights, turns it about the vertical and sets its strength. Other lights
/// among the nodes are left alone.
class DomeLight final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Lights/*";
    TextDistribution textures;
    Distribution intensity = 1000.0;
    Distribution rotation_deg = Range{0.0, 360.0};

    void visit(ParamVisitor& v);
  };

  DomeLight(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  TextureChoice textures_;
};

}  // namespace diorama
