// SPDX-License-Identifier: Apache-2.0
#include "orbit_cameras.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "diorama/node_pattern.h"
#include "diorama/obstacles.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kRolls[] = {"level", "arc"};

/// Places, in the node's space, of the cameras that move with it; its own for what has none.
std::vector<Vec3> cameras_at(const Scene& scene, NodeId node) {
  std::vector<Vec3> places;
  const Affine node_from_world = scene.world_from_node(node).inverse();
  for (const NodeId below : scene.subtree(node)) {
    if (!scene[below].camera) continue;
    places.push_back(below == node
                         ? Vec3(Vec3::Zero())
                         : Vec3(node_from_world * scene.world_from_node(below).translation()));
  }
  if (places.empty()) places.push_back(Vec3::Zero());
  return places;
}

}  // namespace

/// What stands round the cameras. Nothing of it changes while a view is drawn again and again.
struct OrbitCameras::Surroundings {
  Obstacles blocking;         ///< What may not stand between a camera and its target.
  Obstacles all;              ///< What may not be too near to a camera.
  std::vector<Vec3> targets;  ///< Empty: nothing fits the pattern.
  std::vector<NodeId> placed;

  std::uint64_t shape_revision = 0;
  std::map<NodeId, Affine> poses;  ///< In their parents, of all that this depends on.

  bool is_of(const Scene& scene) const {
    return scene.shape_revision() == shape_revision &&
           std::all_of(poses.begin(), poses.end(), [&](const auto& pose) {
             return scene[pose.first].parent_from_node.matrix() == pose.second.matrix();
           });
  }
};

void OrbitCameras::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras (or lights) to place.", kNodePattern});
  v.param("targets", targets, {"Nodes to look at; each camera picks one.", kNodePattern});
  v.param("distance", distance, {"Distance from the target's centre.", "m", 1e-3, 1e5});
  v.param("polar_angle_deg", polar_angle_deg,
          {"Angle off the vertical: 0 looks straight down, 90 level.", "deg", 0, 180});
  v.param("cos_polar_angle", cos_polar_angle,
          {"Cosine of that angle instead: drawn evenly, every direction is as likely. null: "
           "polar_angle_deg.",
           "", -1, 1});
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

OrbitCameras::~OrbitCameras() = default;

void OrbitCameras::look_around(const Scene& scene) {
  if (surroundings_ && surroundings_->is_of(scene)) return;
  // Without obstacles every draw is free, so the first one stands: the same as when switched off.
  const bool avoid = params_.avoid_obstacles;
  const std::vector<NodeId> targets = scene.match(params_.targets);
  surroundings_ = std::make_unique<Surroundings>(
      Surroundings{Obstacles(scene, avoid ? params_.obstacles : std::string()),
                   Obstacles(scene, avoid ? "/**" : ""),
                   centres_of(scene, targets),
                   scene.match(params_.nodes),
                   scene.shape_revision(),
                   {}});
  const auto depend_on = [&](NodeId node) {
    for (; node && surroundings_->poses.emplace(node, scene[node].parent_from_node).second;) {
      node = scene[node].parent;
    }
  };
  for (const NodeId node : scene.subtree(scene.root())) {
    if (scene[node].mesh) depend_on(node);
  }
  for (const NodeId node : targets) depend_on(node);
}

OrbitCameras::View OrbitCameras::draw_view(const std::vector<Vec3>& targets,
                                           NodeDraws draws) const {
  View view;
  view.target = targets[draws.rng.index(targets.size())];
  const double distance = draws.number(params_.distance);
  const double polar =
      params_.cos_polar_angle
          ? std::acos(std::clamp(draws.number(*params_.cos_polar_angle), -1.0, 1.0))
          : radians(draws.number(params_.polar_angle_deg));
  const double azimuth = radians(draws.number(params_.azimuth_deg));
  const Vec3 direction(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
                       std::cos(polar));
  view.position = view.target + distance * direction;
  view.look_at = view.target + draws.vector(params_.look_at_offset);
  return view;
}

/// How far all cameras of the node are from everything, up to the clearance; below 0: one of them
/// does not see the target or stands in something.
double OrbitCameras::clearance_of(const View& view, const std::vector<Vec3>& cameras) const {
  const Affine world_from_node = pose_of(view);
  double clear_m = params_.clearance_m;
  for (const Vec3& camera : cameras) {
    const Vec3 place = camera.isZero() ? view.position : Vec3(world_from_node * camera);
    if (surroundings_->blocking.is_between(place, view.target)) return -1.0;
    if (surroundings_->all.encloser(place)) return -1.0;
    clear_m = surroundings_->all.distance(place, clear_m);
  }
  return clear_m;
}

OrbitCameras::View OrbitCameras::draw_free_view(const std::vector<Vec3>& targets,
                                                const std::vector<Vec3>& cameras,
                                                const NodeDraws& draws) const {
  const auto attempt = [&](int number) {
    return draw_view(targets, {draws.rng.fork(std::uint64_t(number)), draws.index});
  };
  std::optional<View> best;
  double best_m = -1.0;
  for (int i = 0; i < params_.max_tries; ++i) {
    const View view = attempt(i);
    const double clear_m = clearance_of(view, cameras);
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
  look_around(scene);
  const std::vector<Vec3> targets = surroundings_->targets.empty()
                                        ? std::vector<Vec3>{context.working_area_world}
                                        : surroundings_->targets;
  const auto place = [&](NodeId node, const NodeDraws& draws) {
    const View view = draw_free_view(targets, cameras_at(scene, node), draws);
    set_world_pose(scene, node, pose_of(view));
  };
  draw_for_each(scene, surroundings_->placed, context, rng, place);
}

}  // namespace diorama
