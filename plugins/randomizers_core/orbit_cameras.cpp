// SPDX-License-Identifier: Apache-2.0
#include "orbit_cameras.h"

#include "diorama/node_pattern.h"

#include <cmath>
#include <optional>

#include "diorama/obstacles.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRolls[] = {"level", "arc"};

}  // namespace

struct OrbitCameras::Surroundings {
  Obstacles blocking;  ///< What may not stand between a camera and its target.
  Obstacles all;       ///< What may not be too near to a camera.
};

void OrbitCameras::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras (or lights) to place.", kNodePattern});
  v.param("targets", targets, {"Nodes to look at; each camera picks one.", kNodePattern});
  v.param("distance", distance, {"Distance from the target's centre.", "m", 1e-3, 1e5});
  v.param("polar_angle_deg", polar_angle_deg,
          {"Angle off the vertical: 0 looks straight down, 90 level.", "deg", 0, 180});
  v.param("azimuth_deg", azimuth_deg, {"Direction round the vertical.", "deg", -360, 360});
  v.param("look_at_offset", look_at_offset,
          {"Point looked at, from the target's centre; a number is drawn per axis.", "m"}, 3);
  v.choice("roll", roll, kRolls,
           {"level: the horizon is level; arc: the shortest turn from looking down, as the "
            "reference does."});
  v.param("avoid_obstacles", avoid_obstacles,
          {"Draw again while the view of the target is blocked or anything is too near."});
  v.param("obstacles", obstacles, {"Nodes that may block a view.", kNodePattern});
  v.param("clearance_m", clearance_m,
          {"Nothing visible is nearer to a camera. More than the cameras' near_m, or their near "
           "plane cuts things open.",
           "m", 0, 100});
  v.param("max_tries", max_tries, {"Draws per camera at most.", "", 1, 10000});
}

OrbitCameras::OrbitCameras(Params params, Host&) : params_(std::move(params)) {}

OrbitCameras::View OrbitCameras::draw_view(const std::vector<Vec3>& targets,
                                           NodeDraws draws) const {
  View view;
  view.target = targets[draws.rng.index(targets.size())];
  const double distance = draws.number(params_.distance);
  const double polar = radians(draws.number(params_.polar_angle_deg));
  const double azimuth = radians(draws.number(params_.azimuth_deg));
  const Vec3 direction(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
                       std::cos(polar));
  view.position = view.target + distance * direction;
  view.look_at = view.target + draws.vector(params_.look_at_offset);
  return view;
}

OrbitCameras::View OrbitCameras::draw_free_view(const std::vector<Vec3>& targets,
                                                const Surroundings& surroundings,
                                                const NodeDraws& draws) const {
  const auto attempt = [&](int number) {
    return draw_view(targets, {draws.rng.fork(std::uint64_t(number)), draws.index});
  };
  std::optional<View> best;
  double best_m = -1.0;
  for (int i = 0; i < params_.max_tries; ++i) {
    const View view = attempt(i);
    if (surroundings.blocking.is_between(view.position, view.target)) continue;
    if (surroundings.all.encloser(view.position)) continue;
    const double clear_m = surroundings.all.distance(view.position, params_.clearance_m);
    if (clear_m >= params_.clearance_m) return view;
    if (clear_m <= best_m) continue;
    best = view;
    best_m = clear_m;
  }
  return best ? *best : attempt(0);
}

Affine OrbitCameras::pose_of(const View& view) const {
  const Vec3 forward = view.look_at - view.position;
  const Quat rotation = params_.roll == "arc" ? Quat::FromTwoVectors(-Vec3::UnitZ(), forward)
                                              : look_rotation(forward);
  return Affine(Eigen::Translation3d(view.position) * rotation);
}

void OrbitCameras::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> nodes = scene.match(params_.nodes);
  if (nodes.empty()) return;
  const std::vector<Vec3> targets =
      target_centres(scene, params_.targets, context.working_area_world);
  // Without obstacles every draw is free, so the first one stands: the same as when switched off.
  const bool avoid = params_.avoid_obstacles;
  const Surroundings surroundings{Obstacles(scene, avoid ? params_.obstacles : std::string()),
                                  Obstacles(scene, avoid ? "/**" : "")};
  const auto place = [&](NodeId node, const NodeDraws& draws) {
    set_world_pose(scene, node, pose_of(draw_free_view(targets, surroundings, draws)));
  };
  draw_for_each(scene, nodes, context, rng, place);
}

}  // namespace diorama
