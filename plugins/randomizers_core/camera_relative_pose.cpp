// SPDX-License-Identifier: Apache-2.0
#include "camera_relative_pose.h"

#include "diorama/node_pattern.h"

#include "diorama/error.h"
#include "sampling.h"

namespace diorama {
namespace {

/// From -1 (left edge, lower edge) to 1 (right, upper), to pixels.
Vec2 pixel_at(const Camera& camera, double horizontal, double vertical) {
  return {0.5 * (1.0 + horizontal) * camera.width, 0.5 * (1.0 - vertical) * camera.height};
}

}  // namespace

void CameraRelativePose::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to place.", kNodePattern});
  v.param("camera", camera,
          {"The camera; of several that fit, each node picks one.", kNodePattern});
  v.param("distance_m", distance_m, {"Distance from the camera's centre.", "m", 1e-3, 1e5});
  v.param("horizontal", horizontal,
          {"Place in the picture: -1 is the left edge, 1 the right one.", "", -1, 1});
  v.param("vertical", vertical,
          {"Place in the picture: -1 is the lower edge, 1 the upper one.", "", -1, 1});
}

CameraRelativePose::CameraRelativePose(Params params, Host&) : params_(std::move(params)) {}

void CameraRelativePose::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> nodes = scene.match(params_.nodes);
  if (nodes.empty()) return;
  const auto is_camera = [](const Node& node) { return node.camera.has_value(); };
  const std::vector<NodeId> cameras = match_if(scene, params_.camera, is_camera);
  if (cameras.empty()) {
    throw Error(ErrorKind::Config, "'camera': no camera fits '" + params_.camera + "'");
  }
  const auto place = [&](NodeId node, NodeDraws& draws) {
    const NodeId camera = cameras[draws.rng.index(cameras.size())];
    const double distance = draws.number(params_.distance_m);
    const double horizontal = draws.number(params_.horizontal);
    const Vec2 pixel = pixel_at(*scene[camera].camera, horizontal, draws.number(params_.vertical));
    const auto direction = ray_direction(*scene[camera].camera, pixel);
    if (!direction) return;  // a fisheye lens images nothing there
    const Affine world_from_camera(Transform::from_affine(scene.world_from_node(camera)).rotation);
    const Vec3 eye = scene.world_from_node(camera).translation();
    const Vec3 goal = eye + world_from_camera * (distance * *direction);
    const Aabb box = scene.world_bounds(node);
    Affine pose = scene.world_from_node(node);
    const Vec3 centre = box.is_empty() ? Vec3(pose.translation()) : box.centre();
    pose.pretranslate(goal - centre);
    set_world_pose(scene, node, pose);
  };
  draw_for_each(scene, nodes, context, rng, place);
}

}  // namespace diorama
