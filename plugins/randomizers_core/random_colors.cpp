// SPDX-License-Identifier: Apache-2.0
#include "random_colors.h"

#include "diorama/node_pattern.h"

#include <algorithm>

#include "sampling.h"

namespace diorama {
namespace {

/// What the node had, in a plain colour.
std::shared_ptr<const Material> painted(const Node& node, const Vec3& color) {
  const bool has_material = !node.materials.empty() && node.materials.front();
  auto material = std::make_shared<Material>();
  if (has_material) *material = *node.materials.front();
  material->base_color = color.cast<float>();
  material->base_color_texture = TextureInput{};
  return material;
}

}  // namespace

void RandomColors::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to paint; those without a mesh are passed over.", kNodePattern});
  v.param("color", color, {"Red, green and blue, linear.", "", 0, 1}, 3);
}

RandomColors::RandomColors(Params params, Host&) : params_(std::move(params)) {}

void RandomColors::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto paint = [&](NodeId node, NodeDraws& draws) {
    const auto material = painted(scene[node], draws.vector(params_.color));
    auto& slots = scene.edit(node).materials;
    slots.assign(std::max<std::size_t>(1, slots.size()), material);
  };
  const auto has_mesh = [](const Node& node) { return node.mesh != nullptr; };
  draw_for_each(scene, match_if(scene, params_.nodes, has_mesh), context, rng, paint);
}

}  // namespace diorama
