// SPDX-License-Identifier: Apache-2.0
#include "random_colors.h"

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
  v.param("nodes", nodes, {"Nodes to paint; those without a mesh are passed over."});
  v.param("color_min", color_min, {"Least red, green and blue, linear.", "", 0, 1});
  v.param("color_max", color_max, {"Greatest red, green and blue, linear.", "", 0, 1});
}

RandomColors::RandomColors(Params params, Host&) : params_(std::move(params)) {
  check_corners(params_.color_min, params_.color_max, "color_min", "color_max");
}

void RandomColors::randomize(Scene& scene, const RandomizeContext&, const Rng& rng) {
  for (const NodeId id : scene.match(params_.nodes)) {
    if (!scene[id].mesh) continue;
    Rng draws = rng.fork(scene.path(id));
    const Vec3 color = draw_between(params_.color_min, params_.color_max, draws);
    const auto material = painted(scene[id], color);
    auto& slots = scene.edit(id).materials;
    slots.assign(std::max<std::size_t>(1, slots.size()), material);
  }
}

}  // namespace diorama
