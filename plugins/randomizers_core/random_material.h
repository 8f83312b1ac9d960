// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "box_mapping.h"
#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"
#include "material_folder.h"

namespace diorama {

struct NodeDraws;

/// Draws the materials of every mesh among the nodes anew: first, if `assets` or `folders` are
/// given, the whole material is one of theirs, then roughness and metalness are set where they are
/// given. Other inputs stay; a texture of what was drawn goes. Meshes without uv coordinates get
/// some by box mapping with a whole material.
class RandomMaterial final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Distractors/**";
    TextDistribution assets;
    std::vector<std::string> folders;
    Distribution repeat = 1.0;
    double picture_m = 0.3;
    std::optional<Distribution> roughness = Range{0.1, 0.9};
    std::optional<Distribution> metallic;

    void visit(ParamVisitor& v);
  };

  RandomMaterial(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  std::shared_ptr<const Material> material_of(std::size_t asset);
  Material draw_material(NodeDraws& draws);

  Params params_;
  Host& host_;
  std::vector<std::shared_ptr<const Material>> materials_;  ///< One per asset; null: not yet read.
  std::vector<MaterialMaps> maps_;                          ///< Of all folders.
  MaterialReader reader_;
  BoxMapping box_mapping_;
};

}  // namespace diorama
