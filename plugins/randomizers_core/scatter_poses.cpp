// SPDX-License-Identifier: Apache-2.0
#include "scatter_poses.h"

#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRotations[] = {"uniform", "euler", "upright", "none"};

double radians(double degrees) { return degrees * kPi / 180.0; }

}  // namespace

void ScatterPoses::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to place."});
  v.param("offset_min", offset_min, {"Lower corner of the box, from the working area.", "m"});
  v.param("offset_max", offset_max, {"Upper corner of the box, from the working area.", "m"});
  v.choice(
      "rotation", rotation, kRotations,
      {"uniform: every orientation is as likely; euler: angles about x, y and z, each drawn "
       "from rotation_deg (favours the poles); upright: about z alone, from rotation_deg; none."});
  v.param("rotation_deg", rotation_deg, {"Angles of euler and upright.", "deg", -360, 360});
  v.param("scale", scale, {"Scale, the same along all axes.", "", 1e-4, 1e4});
}

ScatterPoses::ScatterPoses(Params params, Host&) : params_(std::move(params)) {
  check_corners(params_.offset_min, params_.offset_max, "offset_min", "offset_max");
}

Quat ScatterPoses::draw_rotation(Rng& rng) const {
  if (params_.rotation == "uniform") return rng.uniform_rotation();
  if (params_.rotation == "none") return Quat::Identity();
  const auto about = [&](const Vec3& axis) {
    return Quat(Eigen::AngleAxisd(radians(draw_in(params_.rotation_deg, rng)), axis));
  };
  if (params_.rotation == "upright") return about(Vec3::UnitZ());
  const Quat x = about(Vec3::UnitX());
  const Quat y = about(Vec3::UnitY());
  const Quat z = about(Vec3::UnitZ());
  return z * y * x;
}

void ScatterPoses::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  for (const NodeId node : scene.match(params_.nodes)) {
    Rng draws = rng.fork(scene.path(node));
    Transform pose;
    pose.translation =
        context.working_area_world + draw_between(params_.offset_min, params_.offset_max, draws);
    pose.rotation = draw_rotation(draws);
    pose.scale = Vec3::Constant(draw_in(params_.scale, draws));
    set_world_pose(scene, node, pose.affine());
  }
}

}  // namespace diorama
