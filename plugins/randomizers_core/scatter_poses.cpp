// SPDX-License-Identifier: Apache-2.0
#include "scatter_poses.h"

#include "diorama/node_pattern.h"

#include <optional>

#include "free_space.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRotations[] = {"uniform", "euler", "upright", "none"};

Quat about(const Vec3& axis, double degrees) {
  return Quat(Eigen::AngleAxisd(radians(degrees), axis));
}

}  // namespace

void ScatterPoses::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to place.", kNodePattern});
  v.param("offset", offset, {"Place, from the working area along the world's axes.", "m"}, 3);
  v.choice("rotation", rotation, kRotations,
           {"uniform: every orientation is as likely; euler: angles about x, then y, then z, from "
            "rotation_deg (drawn evenly they favour the poles); upright: about z alone, from "
            "rotation_deg; none."});
  v.param("rotation_deg", rotation_deg,
          {"Angles of euler (a number is drawn per axis) and upright.", "deg", -360, 360}, 3);
  v.param("scale", scale, {"Scale; a single number is that of all axes.", "", 1e-4, 1e4}, 3);
  v.param("avoid_overlap", avoid_overlap,
          {"Draw the place again while the node would stand in an obstacle or in a node placed "
           "before it."});
  v.param("obstacles", obstacles,
          {"Nodes that must not be met, with all below them; objects that wait to be placed are in "
           "nobody's way.",
           kNodePattern});
  v.param("clearance_m", clearance_m, {"Distance kept from them.", "m", 0, 100});
  v.param("max_tries", max_tries, {"Draws per node at most.", "", 1, 100000});
}

ScatterPoses::ScatterPoses(Params params, Host& host) : params_(std::move(params)), host_(host) {}

Quat ScatterPoses::draw_rotation(NodeDraws& draws) const {
  if (params_.rotation == "uniform") return draws.rng.uniform_rotation();
  if (params_.rotation == "none") return Quat::Identity();
  if (params_.rotation == "upright" && params_.rotation_deg.width() == 1) {
    return about(Vec3::UnitZ(), draws.number(params_.rotation_deg));
  }
  const Vec3 angles = draws.vector(params_.rotation_deg);
  if (params_.rotation == "upright") return about(Vec3::UnitZ(), angles.z());
  return about(Vec3::UnitZ(), angles.z()) * about(Vec3::UnitY(), angles.y()) *
         about(Vec3::UnitX(), angles.x());
}

void ScatterPoses::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> nodes = scene.match(params_.nodes);
  std::optional<FreeSpace> space;
  if (params_.avoid_overlap) space.emplace(scene, params_.obstacles, nodes);
  const auto draw_place = [&](NodeDraws& draws) -> Vec3 {
    return context.working_area_world + draws.vector(params_.offset);
  };
  const auto is_free = [&](NodeId node, const Transform& pose) {
    return !space || space->holds(scene, node, pose.affine(), params_.clearance_m);
  };
  int crowded = 0;
  const auto place = [&](NodeId node, NodeDraws& draws) {
    const Rng again = draws.rng.fork("again");
    Transform pose;
    pose.translation = draw_place(draws);
    pose.rotation = draw_rotation(draws);
    pose.scale = draws.scale(params_.scale);
    const Vec3 first = pose.translation;
    bool found = is_free(node, pose);
    for (int i = 1; !found && i < params_.max_tries; ++i) {
      NodeDraws more{again.fork(std::uint64_t(i)), draws.index};
      pose.translation = draw_place(more);
      if (pose.translation == first) break;  // there is but one place
      found = is_free(node, pose);
    }
    if (!found) {
      pose.translation = first;
      ++crowded;
    }
    set_world_pose(scene, node, pose.affine());
    if (space) space->add(scene, node);
  };
  draw_for_each(scene, nodes, context, rng, place);
  if (crowded > 0) {
    host_.log(LogLevel::Warning, std::to_string(crowded) + " of " + std::to_string(nodes.size()) +
                                     " nodes that fit '" + params_.nodes +
                                     "' found no free place, so they start inside something");
  }
}

}  // namespace diorama
