// SPDX-License-Identifier: Apache-2.0
#include "scatter_poses.h"

#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRotations[] = {"uniform", "euler", "upright", "none"};

Quat about(const Vec3& axis, double degrees) {
  return Quat(Eigen::AngleAxisd(radians(degrees), axis));
}

}  // namespace

void ScatterPoses::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to place."});
  v.param("offset", offset, {"Place, from the working area along the world's axes.", "m"}, 3);
  v.choice("rotation", rotation, kRotations,
           {"uniform: every orientation is as likely; euler: angles about x, then y, then z, from "
            "rotation_deg (drawn evenly they favour the poles); upright: about z alone, from "
            "rotation_deg; none."});
  v.param("rotation_deg", rotation_deg,
          {"Angles of euler (a number is drawn per axis) and upright.", "deg", -360, 360}, 3);
  v.param("scale", scale, {"Scale; a single number is that of all axes.", "", 1e-4, 1e4}, 3);
}

ScatterPoses::ScatterPoses(Params params, Host&) : params_(std::move(params)) {}

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
  const auto place = [&](NodeId node, NodeDraws& draws) {
    Transform pose;
    pose.translation = context.working_area_world + draws.vector(params_.offset);
    pose.rotation = draw_rotation(draws);
    pose.scale = draws.scale(params_.scale);
    set_world_pose(scene, node, pose.affine());
  };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, place);
}

}  // namespace diorama
