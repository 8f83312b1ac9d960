// SPDX-License-Identifier: Apache-2.0
#include "random_material.h"

#include "diorama/node_pattern.h"

#include "diorama/error.h"
#include "sampling.h"

namespace diorama {
namespace {

std::shared_ptr<const Material> first_material(const Scene& scene) {
  for (const NodeId node : scene.subtree(scene.root())) {
    for (const auto& material : scene[node].materials) {
      if (material) return material;
    }
  }
  return nullptr;
}

}  // namespace

void RandomMaterial::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to change; those without a mesh are passed over.", kNodePattern});
  v.param("assets", assets,
          {"Model files whose first material is put on the mesh; none: the mesh keeps its own."});
  v.param("roughness", roughness,
          {"Perceptual roughness: 0 is a mirror, 1 is matt; null keeps it.", "", 0, 1});
  v.param("metallic", metallic,
          {"0: plastic, wood, cloth; 1: bare metal; null keeps it.", "", 0, 1});
}

RandomMaterial::RandomMaterial(Params params, Host& host)
    : params_(std::move(params)), host_(host), materials_(params_.assets.texts().size()) {
  for (const std::string& name : params_.assets.texts()) {
    // What a loader makes up, "scheme:rest", is no file.
    const bool is_file = name.find(':') == std::string::npos || name.starts_with("file:");
    if (is_file) (void)host_.resolve(name);
  }
}

std::shared_ptr<const Material> RandomMaterial::material_of(std::size_t asset) {
  if (materials_[asset]) return materials_[asset];
  const std::string& name = params_.assets.texts()[asset];
  Scene scene;
  host_.load_asset(name, scene, scene.root());
  materials_[asset] = first_material(scene);
  if (!materials_[asset]) throw Error(ErrorKind::Asset, name + ": has no material");
  return materials_[asset];
}

void RandomMaterial::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    auto& slots = scene.edit(node).materials;
    if (slots.empty()) slots.resize(1);
    for (auto& slot : slots) {
      if (!materials_.empty()) slot = material_of(draws.text(params_.assets));
      auto material = slot ? std::make_shared<Material>(*slot) : std::make_shared<Material>();
      if (params_.roughness) {
        material->roughness = float(draws.number(*params_.roughness));
        material->roughness_texture = TextureInput{};
      }
      if (params_.metallic) {
        material->metallic = float(draws.number(*params_.metallic));
        material->metallic_texture = TextureInput{};
      }
      slot = std::move(material);
    }
  };
  const auto has_mesh = [](const Node& node) { return node.mesh != nullptr; };
  draw_for_each(scene, match_if(scene, params_.nodes, has_mesh), context, rng, change);
}

}  // namespace diorama
