// SPDX-License-Identifier: Apache-2.0
#include "camera_motion.h"

#include "diorama/node_pattern.h"

#include "sampling.h"

namespace diorama {

void CameraMotion::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras to move.", kNodePattern});
  v.param("velocity", velocity, {"Along the camera's axes: right, up, backwards.", "m/s"}, 3);
  v.param("angular_velocity_deg", angular_velocity_deg,
          {"About the camera's axes: right (tilt), up (pan), backwards (roll).", "deg/s"}, 3);
  v.param("exposure_time_s", exposure_time_s,
          {"How long a row gathers light; null keeps it.", "s", 0, 10});
}

CameraMotion::CameraMotion(Params params, Host&) : params_(std::move(params)) {}

void CameraMotion::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    const Mat3 world_from_axes = scene.world_from_node(node).rotation();
    Camera& camera = *scene.edit(node).camera;
    camera.linear_velocity = world_from_axes * draws.vector(params_.velocity);
    camera.angular_velocity =
        world_from_axes * draws.vector(params_.angular_velocity_deg) * (kPi / 180.0);
    if (params_.exposure_time_s) camera.exposure_time_s = draws.number(*params_.exposure_time_s);
  };
  const auto is_camera = [](const Node& node) { return node.camera.has_value(); };
  draw_for_each(scene, match_if(scene, params_.nodes, is_camera), context, rng, change);
}

}  // namespace diorama
