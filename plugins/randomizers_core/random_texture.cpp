// SPDX-License-Identifier: Apache-2.0
#include "random_texture.h"

#include <algorithm>

#include "diorama/node_pattern.h"
#include "sampling.h"

namespace diorama {

void RandomTexture::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to change; those without a mesh are passed over.", kNodePattern});
  v.param("textures", textures, {"Image files to choose from; none: the mesh keeps what it has."});
  v.param("repeat", repeat, {"How often the picture fits along the mesh's uv.", "", 1e-3, 1e3});
  v.param("rotation_deg", rotation_deg, {"Turn of the picture.", "deg", -360, 360});
  v.param("picture_m", picture_m,
          {"Size of the picture on meshes without uv, before it is repeated.", "m", 1e-3, 1e3});
}

RandomTexture::RandomTexture(Params params, Host& host)
    : params_(std::move(params)), textures_(params_.textures, host) {}

void RandomTexture::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  if (textures_.is_empty()) return;
  const auto change = [&](NodeId node, NodeDraws& draws) {
    TextureInput input;
    input.texture = textures_.draw(draws);
    const double repeat =
        draws.number(params_.repeat) * box_mapping_.fit(scene, node, params_.picture_m);
    const Eigen::Rotation2Dd turn(radians(draws.number(params_.rotation_deg)));
    input.uv_from_mesh_uv.leftCols<2>() = (repeat * turn.toRotationMatrix()).cast<float>();
    auto& slots = scene.edit(node).materials;
    slots.resize(std::max<std::size_t>(1, slots.size()));
    for (auto& slot : slots) {
      auto material = slot ? std::make_shared<Material>(*slot) : std::make_shared<Material>();
      material->base_color = Vec3f::Ones();
      material->base_color_texture = input;
      slot = std::move(material);
    }
  };
  const auto has_mesh = [](const Node& node) { return node.mesh != nullptr; };
  draw_for_each(scene, match_if(scene, params_.nodes, has_mesh), context, rng, change);
}

}  // namespace diorama
