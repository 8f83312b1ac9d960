// SPDX-License-Identifier: Apache-2.0
#include "random_material.h"

#include "diorama/error.h"
#include "diorama/node_pattern.h"
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
  v.param(
      "folders", folders,
      {"Folders of materials as ambientCG and Poly Haven name them (Color or diff, Roughness or "
       "rough, NormalGL or nor_gl, Metalness, arm ...), at any depth: the whole material is one "
       "of theirs. Not with assets."});
  v.param("repeat", repeat,
          {"How often a whole material's pictures fit along the mesh's uv.", "", 1e-3, 1e3});
  v.param(
      "picture_m", picture_m,
      {"Size of these pictures on meshes without uv, before they are repeated.", "m", 1e-3, 1e3});
  v.param(
      "roughness", roughness,
      {"Perceptual roughness: 0 is a mirror, 1 is matt; null keeps it, and so does a picture of "
       "it in `folders`.",
       "", 0, 1});
  v.param("metallic", metallic,
          {"0: plastic, wood, cloth; 1: bare metal; null keeps it, and so does a picture of it in "
           "`folders`.",
           "", 0, 1});
}

RandomMaterial::RandomMaterial(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      materials_(params_.assets.texts().size()),
      reader_(host) {
  if (!materials_.empty() && !params_.folders.empty()) {
    throw Error(ErrorKind::Config,
                "both 'assets' and 'folders' are given, expected one of them; two randomizers with "
                "nodes of their own can have both");
  }
  for (const std::string& folder : params_.folders) {
    for (MaterialMaps& maps : find_materials(folder, host)) maps_.push_back(std::move(maps));
  }
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

Material RandomMaterial::draw_material(NodeDraws& draws) {
  if (!maps_.empty()) return reader_.read(maps_[draws.rng.index(maps_.size())]);
  return *material_of(draws.text(params_.assets));
}

void RandomMaterial::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const bool is_of_folder = !maps_.empty();
  const bool is_whole = is_of_folder || !materials_.empty();
  const auto change = [&](NodeId node, NodeDraws& draws) {
    float times = 1.0f;
    if (is_whole) {
      Rng own = draws.rng.fork("repeat");
      times = float(params_.repeat.draw(own, draws.index)) *
              box_mapping_.fit(scene, node, params_.picture_m);
    }
    auto& slots = scene.edit(node).materials;
    if (slots.empty()) slots.resize(1);
    for (auto& slot : slots) {
      auto material = slot ? std::make_shared<Material>(*slot) : std::make_shared<Material>();
      if (is_whole) {
        *material = draw_material(draws);
        repeat_textures(*material, times);
      }
      if (params_.roughness && !(is_of_folder && material->roughness_texture)) {
        material->roughness = float(draws.number(*params_.roughness));
        material->roughness_texture = TextureInput{};
      }
      if (params_.metallic && !(is_of_folder && material->metallic_texture)) {
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
