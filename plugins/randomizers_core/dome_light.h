// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Picks a sky for dome lights, turns it about the vertical and sets its strength. Other lights
/// among the nodes are left alone. Skies are read when picked and kept as long as a scene uses
/// them.
class DomeLight final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Lights/*";
    std::vector<std::string> textures;
    Range intensity{1.0, 1.0};
    Range rotation_deg{0.0, 360.0};

    void visit(ParamVisitor& v);
  };

  DomeLight(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  std::shared_ptr<const Texture> texture(std::size_t index);

  Params params_;
  Host& host_;
  std::vector<std::weak_ptr<const Texture>> read_;  ///< One per entry of params_.textures.
};

}  // namespace diorama
