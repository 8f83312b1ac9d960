// SPDX-License-Identifier: Apache-2.0
#include "orbit_cameras.h"

#include <cmath>
#include <optional>

#include "obstacles.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRolls[] = {"level", "arc"};

double radians(double degrees) { return degrees * kPi / 180.0; }

std::vector<Vec3> target_centres(const Scene& scene, const std::string& pattern,
                                 const Vec3& fallback) {
  std::vector<Vec3> centres;
  for (const NodeId node : scene.match(pattern)) {
    const Aabb box = scene.world_bounds(node);
    centres.push_back(box.is_empty() ? Vec3(scene.world_from_node(node).translation())
                                     : box.centre());
  }
  if (centres.empty()) centres.push_back(fallback);
  return centres;
}

}  // namespace

void OrbitCameras::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras to place."});
  v.param("targets", targets, {"Nodes to look at; each camera picks one."});
  v.param("distance", distance, {"Distance from the target's centre.", "m", 1e-3, 1e5});
  v.param("polar_angle_deg", polar_angle_deg,
          {"Angle off the vertical: 0 looks straight down, 90 level.", "deg", 0, 180});
  v.param("azimuth_deg", azimuth_deg, {"Direction round the vertical.", "deg", -360, 360});
  v.param("look_at_jitter", look_at_jitter,
          {"The camera looks past the centre by at most this along each axis.", "m", 0, 1e3});
  v.choice("roll", roll, kRolls,
           {"level: the horizon is level; arc: the shortest turn from looking down, as the "
            "reference does."});
  v.param("avoid_obstacles", avoid_obstacles,
          {"Draw again while the view of the target is blocked or something is too near."});
  v.param("obstacles", obstacles, {"Nodes that may block a view."});
  v.param("clearance_m", clearance_m,
          {"Nothing of the obstacles is nearer to a camera.", "m", 0, 100});
  v.param("max_tries", max_tries, {"Draws per camera at most.", "", 1, 10000});
}

OrbitCameras::OrbitCameras(Params params, Host&) : params_(std::move(params)) {}

OrbitCameras::View OrbitCameras::draw_view(const std::vector<Vec3>& targets, Rng rng) const {
  View view;
  view.target = targets[rng.index(targets.size())];
  const double distance = draw_in(params_.distance, rng);
  const double polar = radians(draw_in(params_.polar_angle_deg, rng));
  const double azimuth = radians(draw_in(params_.azimuth_deg, rng));
  const Vec3 direction(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
                       std::cos(polar));
  view.position = view.target + distance * direction;
  const Vec3 jitter = Vec3::Constant(params_.look_at_jitter);
  view.look_at = view.target + draw_between(-jitter, jitter, rng);
  return view;
}

OrbitCameras::View OrbitCameras::draw_free_view(const std::vector<Vec3>& targets,
                                                const Obstacles& obstacles, const Rng& rng) const {
  std::optional<View> unblocked;
  for (int i = 0; i < params_.max_tries; ++i) {
    const View view = draw_view(targets, rng.fork(std::uint64_t(i)));
    if (obstacles.is_between(view.position, view.target)) continue;
    if (!obstacles.is_near(view.position, params_.clearance_m)) return view;
    if (!unblocked) unblocked = view;
  }
  return unblocked ? *unblocked : draw_view(targets, rng.fork(std::uint64_t(0)));
}

Affine OrbitCameras::pose_of(const View& view) const {
  const Vec3 forward = view.look_at - view.position;
  const Quat rotation = params_.roll == "arc" ? Quat::FromTwoVectors(-Vec3::UnitZ(), forward)
                                              : look_rotation(forward);
  return Affine(Eigen::Translation3d(view.position) * rotation);
}

void OrbitCameras::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> cameras = scene.match(params_.nodes);
  if (cameras.empty()) return;
  const std::vector<Vec3> targets =
      target_centres(scene, params_.targets, context.working_area_world);
  // Without obstacles every draw is free, so the first one stands: the same as when switched off.
  const Obstacles obstacles(scene, params_.avoid_obstacles ? params_.obstacles : std::string());
  for (const NodeId camera : cameras) {
    if (!scene[camera].camera) continue;
    const View view = draw_free_view(targets, obstacles, rng.fork(scene.path(camera)));
    set_world_pose(scene, camera, pose_of(view));
  }
}

}  // namespace diorama
