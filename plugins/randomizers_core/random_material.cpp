// SPDX-License-Identifier: Apache-2.0
#include "random_material.h"

#include "sampling.h"

namespace diorama {

void RandomMaterial::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to change; those without a mesh are passed over."});
  v.param("roughness", roughness, {"Perceptual roughness: 0 is a mirror, 1 is matt.", "", 0, 1});
  v.param("metallic", metallic, {"0: plastic, wood, cloth; 1: bare metal.", "", 0, 1});
}

RandomMaterial::RandomMaterial(Params params, Host&) : params_(std::move(params)) {}

void RandomMaterial::randomize(Scene& scene, const RandomizeContext&, const Rng& rng) {
  for (const NodeId id : scene.match(params_.nodes)) {
    if (!scene[id].mesh) continue;
    Rng draws = rng.fork(scene.path(id));
    auto& slots = scene.edit(id).materials;
    if (slots.empty()) slots.resize(1);
    for (auto& slot : slots) {
      auto material = slot ? std::make_shared<Material>(*slot) : std::make_shared<Material>();
      material->roughness = float(draw_in(params_.roughness, draws));
      material->metallic = float(draw_in(params_.metallic, draws));
      material->roughness_texture = TextureInput{};
      material->metallic_texture = TextureInput{};
      slot = std::move(material);
    }
  }
}

}  // namespace diorama
