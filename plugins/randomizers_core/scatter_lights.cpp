// SPDX-License-Identifier: Apache-2.0
#include "scatter_lights.h"

#include "sampling.h"

namespace diorama {
namespace {

bool is_placeable(const std::optional<Light>& light) {
  return light && light->kind != LightKind::Dome && light->kind != LightKind::Distant;
}

}  // namespace

void ScatterLights::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Lights to place."});
  v.param("offset_min", offset_min, {"Lower corner of the box, from the working area.", "m"});
  v.param("offset_max", offset_max, {"Upper corner of the box, from the working area.", "m"});
  v.param("color_min", color_min, {"Least red, green and blue, linear.", "", 0, 1});
  v.param("color_max", color_max, {"Greatest red, green and blue, linear.", "", 0, 1});
  v.param("intensity", intensity,
          {"Radiance of the light's surface for white; Replicator's number, in nits, divided by "
           "1000.",
           "W/(m^2 sr)", 0, 1e9});
  v.param("radius_m", radius_m,
          {"Radius of sphere and disk lights; [0, 0] keeps what they have.", "m", 0, 1000});
}

ScatterLights::ScatterLights(Params params, Host&) : params_(std::move(params)) {
  check_corners(params_.offset_min, params_.offset_max, "offset_min", "offset_max");
  check_corners(params_.color_min, params_.color_max, "color_min", "color_max");
}

void ScatterLights::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  for (const NodeId node : scene.match(params_.nodes)) {
    if (!is_placeable(scene[node].light)) continue;
    Rng draws = rng.fork(scene.path(node));
    Affine pose = scene.world_from_node(node);
    pose.translation() =
        context.working_area_world + draw_between(params_.offset_min, params_.offset_max, draws);
    set_world_pose(scene, node, pose);
    const Vec3 color = draw_between(params_.color_min, params_.color_max, draws);
    const double intensity = draw_in(params_.intensity, draws);
    const double radius_m = draw_in(params_.radius_m, draws);
    Light& light = *scene.edit(node).light;
    light.color = (intensity * color).cast<float>();
    if (params_.radius_m.hi > 0.0) light.radius_m = radius_m;
  }
}

}  // namespace diorama
