// SPDX-License-Identifier: Apache-2.0
#include "dome_light.h"

#include "diorama/node_pattern.h"

#include "sampling.h"

namespace diorama {

void DomeLight::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Dome lights to change.", kNodePattern});
  v.param("textures", textures,
          {"Equirectangular images to choose from; none: the light keeps what it has."});
  v.param(
      "intensity", intensity,
      {"Luminance of a pixel of value 1, or of the whole sky without an image.", "nit", 0, 1e9});
  v.param("rotation_deg", rotation_deg, {"Turn about the vertical.", "deg", -360, 360});
}

DomeLight::DomeLight(Params params, Host& host)
    : params_(std::move(params)), textures_(params_.textures, host) {}

void DomeLight::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    const double angle = radians(draws.number(params_.rotation_deg));
    Affine pose = Affine(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
    pose.translation() = scene.world_from_node(node).translation();
    set_world_pose(scene, node, pose);
    Light& light = *scene.edit(node).light;
    light.color = Vec3f::Constant(float(draws.number(params_.intensity)));
    if (!textures_.is_empty()) light.texture = textures_.draw(draws);
  };
  const auto is_dome = [](const Node& node) {
    return node.light && node.light->kind == LightKind::Dome;
  };
  draw_for_each(scene, match_if(scene, params_.nodes, is_dome), context, rng, change);
}

}  // namespace diorama
