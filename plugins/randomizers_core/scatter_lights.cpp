// SPDX-License-Identifier: Apache-2.0
#include "scatter_lights.h"

#include "sampling.h"

namespace diorama {
namespace {

bool is_placeable(const Node& node) {
  return node.light && node.light->kind != LightKind::Dome &&
         node.light->kind != LightKind::Distant;
}

}  // namespace

void ScatterLights::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Lights to place."});
  v.param("offset", offset, {"Place, from the working area along the world's axes.", "m"}, 3);
  v.param("color", color, {"Red, green and blue, linear.", "", 0, 1}, 3);
  v.param("intensity", intensity,
          {"Luminance of the light's surface for white, as in Replicator.", "nit", 0, 1e9});
  v.param("radius_m", radius_m,
          {"Radius of sphere and disk lights; null keeps what they have.", "m", 0, 1000});
}

ScatterLights::ScatterLights(Params params, Host&) : params_(std::move(params)) {}

void ScatterLights::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    Affine pose = scene.world_from_node(node);
    pose.translation() = context.working_area_world + draws.vector(params_.offset);
    set_world_pose(scene, node, pose);
    Light& light = *scene.edit(node).light;
    const Vec3 color = draws.vector(params_.color);
    light.color = (draws.number(params_.intensity) * color).cast<float>();
    if (params_.radius_m) light.radius_m = draws.number(*params_.radius_m);
  };
  draw_for_each(scene, match_if(scene, params_.nodes, is_placeable), context, rng, change);
}

}  // namespace diorama
