// SPDX-License-Identifier: Apache-2.0
#include "look_at.h"

#include "diorama/node_pattern.h"

#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kAxes[] = {"-z", "+z", "+x", "+y"};

/// From the node's axes to those of a view, which looks along -z with +y up. The node's +z goes up
/// where it can.
Quat view_from_axis(const std::string& axis) {
  Mat3 view_from_node = Mat3::Identity();
  if (axis == "+z") view_from_node << -1, 0, 0, 0, 1, 0, 0, 0, -1;
  if (axis == "+x") view_from_node << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  if (axis == "+y") view_from_node << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return Quat(view_from_node);
}

}  // namespace

void LookAt::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras, lights or objects to turn.", kNodePattern});
  v.param("targets", targets, {"Nodes to look at; each node picks one.", kNodePattern});
  v.param("offset", offset, {"Point looked at, from the target's centre.", "m"}, 3);
  v.param("roll_deg", roll_deg, {"Turn about the viewing direction.", "deg", -360, 360});
  v.choice("axis", axis, kAxes,
           {"The node's axis that points at the target; cameras and lights look along -z."});
}

LookAt::LookAt(Params params, Host&) : params_(std::move(params)) {}

void LookAt::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<Vec3> targets =
      target_centres(scene, params_.targets, context.working_area_world);
  const auto turn = [&](NodeId node, NodeDraws& draws) {
    Transform pose = Transform::from_affine(scene.world_from_node(node));
    const Vec3 target = targets[draws.rng.index(targets.size())];
    const Vec3 point = target + draws.vector(params_.offset);
    const Quat roll(Eigen::AngleAxisd(radians(draws.number(params_.roll_deg)), Vec3::UnitZ()));
    if ((point - pose.translation).norm() < 1e-9) return;
    pose.rotation = look_rotation(point - pose.translation) * roll * view_from_axis(params_.axis);
    set_world_pose(scene, node, pose.affine());
  };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, turn);
}

}  // namespace diorama
