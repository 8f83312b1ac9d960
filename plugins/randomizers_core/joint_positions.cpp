// SPDX-License-Identifier: Apache-2.0
#include "joint_positions.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "diorama/joints.h"
#include "diorama/node_pattern.h"
#include "sampling.h"

namespace diorama {

void JointPositions::Params::visit(ParamVisitor& v) {
  v.param("joints", joints,
          {"Joints to move; those that mimic others follow these.", kNodePattern});
  v.param("moved_chance", moved_chance,
          {"Probability that a joint is moved; else it stays as it is.", "", 0, 1});
  v.param("share", share,
          {"Position as a share of the range of the limits. Turns without limits go all round; "
           "other joints that lack a limit stay.",
           "", 0, 1});
  v.param("angle_deg", angle_deg,
          {"Position of what turns instead, kept within the limits.", "deg", -1e6, 1e6});
  v.param("distance_m", distance_m,
          {"Position of what slides instead, kept within the limits.", "m", -1e4, 1e4});
}

JointPositions::JointPositions(Params params, Host&) : params_(std::move(params)) {}

void JointPositions::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  std::set<NodeId> wanted;
  for (const std::string& pattern : params_.joints) {
    for (const NodeId node : scene.match(pattern)) wanted.insert(node);
  }
  std::vector<NodeId> joints;
  for (const NodeId node : joints_of(scene)) {
    const Joint& joint = *scene[node].joint;
    if (joint.kind != JointKind::Fixed && !joint.mimic && wanted.contains(node)) {
      joints.push_back(node);
    }
  }
  std::vector<JointTarget> targets;
  draw_for_each(scene, joints, context, rng, [&](NodeId node, NodeDraws& draws) {
    const Joint& joint = *scene[node].joint;
    const double chance = draws.number(params_.moved_chance);
    const bool is_moved = draws.rng.chance(chance);
    const auto& said = joint.kind == JointKind::Revolute ? params_.angle_deg : params_.distance_m;
    const double unit = joint.kind == JointKind::Revolute ? radians(1.0) : 1.0;
    const double number = draws.number(said ? *said : params_.share);
    if (!is_moved) return;
    if (said) {
      targets.push_back({node, std::clamp(unit * number, joint.lower, joint.upper)});
      return;
    }
    double lower = joint.lower;
    double upper = joint.upper;
    const bool has_no_limit = std::isinf(lower) && std::isinf(upper);
    if (joint.kind == JointKind::Revolute && has_no_limit) {
      lower = -kPi;
      upper = kPi;
    }
    if (std::isinf(lower) || std::isinf(upper)) return;
    targets.push_back({node, lower + number * (upper - lower)});
  });
  pose_joints(scene, targets);
}

}  // namespace diorama
