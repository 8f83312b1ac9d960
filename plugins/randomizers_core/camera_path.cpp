// SPDX-License-Identifier: Apache-2.0
#include "camera_path.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "camera_curves.h"
#include "diorama/error.h"
#include "diorama/node_pattern.h"
#include "sampling.h"
#include "walk_plan.h"

namespace diorama {
namespace {

constexpr const char* kKinds[] = {"keys", "orbit", "follow", "walk"};
constexpr const char* kLooks[] = {"targets", "ahead"};

Affine looking(const Vec3& from, const Vec3& at) {
  const Vec3 forward = at - from;
  const Quat rotation = forward.norm() > 1e-9 ? look_rotation(forward) : Quat::Identity();
  return Affine(Eigen::Translation3d(from) * rotation);
}

Vec3 centre_of(const Scene& scene, NodeId node) { return centres_of(scene, {node}).front(); }

/// How far the cameras of a rig are from its origin.
double reach_of(const Scene& scene, NodeId node) {
  const Vec3 origin = scene.world_from_node(node).translation();
  double reach = 0.0;
  for (const NodeId below : scene.subtree(node)) {
    if (!scene[below].camera) continue;
    reach = std::max(reach, (scene.world_from_node(below).translation() - origin).norm());
  }
  return reach;
}

}  // namespace

/// Where a camera is at a time of its clip; asked in the order of time.
struct CameraPath::Path {
  virtual ~Path() = default;
  virtual Affine pose(const Scene& scene, double time_s) = 0;
};

struct CameraPath::Keys final : Path {
  explicit Keys(std::vector<KeyCurve::Key> keys) : curve(std::move(keys)) {}
  Affine pose(const Scene&, double time_s) override { return curve.pose(time_s); }
  KeyCurve curve;
};

struct CameraPath::Orbit final : Path {
  Affine pose(const Scene&, double time_s) override {
    const double angle = azimuth + turn_s * time_s;
    const Vec3 direction(std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle),
                         std::cos(polar));
    return looking(centre + distance * direction, look_at);
  }
  Vec3 centre = Vec3::Zero();
  Vec3 look_at = Vec3::Zero();
  double distance = 1.0, polar = 0.0, azimuth = 0.0, turn_s = 0.0;  // radians
};

/// Falls behind the faster the target is, as what is towed.
struct CameraPath::Follow final : Path {
  Affine pose(const Scene& scene, double time_s) override {
    const Vec3 now = target && scene.contains(target) ? centre_of(scene, target) : centre;
    if (time_s <= 0.0 || lag_s <= 0.0) {
      centre = now;
    } else {
      centre += (1.0 - std::exp((last_s - time_s) / lag_s)) * (now - centre);
    }
    last_s = time_s;
    return looking(centre + offset, centre);
  }
  NodeId target;  ///< Null: the centre stays.
  Vec3 offset = Vec3::Zero();
  double lag_s = 0.0;
  Vec3 centre = Vec3::Zero();
  double last_s = 0.0;
};

/// Waits for what flies or rolls across the way, and steps back from what comes nearer.
struct CameraPath::Walk final : Path {
  explicit Walk(const std::vector<Vec3>& places) : curve(places) {}
  Affine pose(const Scene& scene, double time_s) override {
    const double step = speed * (time_s - last_s);
    last_s = time_s;
    things.look(scene);
    const double from = gone_m;
    double farthest = -1.0;
    for (const double wanted : {from + step, from, from - step}) {
      const double there = std::clamp(wanted, 0.0, curve.length_m());
      const double distance = std::min(things.distance(curve.place(there)), clearance_m);
      if (distance <= farthest) continue;
      farthest = distance;
      gone_m = there;
    }
    const Vec3 place = curve.place(gone_m);
    return looking(place, target ? *target : Vec3(place + curve.direction(gone_m)));
  }
  WalkCurve curve;
  double speed = 0.0;
  std::optional<Vec3> target;  ///< Nothing: it looks ahead.
  MovingThings things;
  double clearance_m = 0.0;  ///< Of the path itself.
  double gone_m = 0.0;
  double last_s = 0.0;
};

struct CameraPath::Moving {
  NodeId node;
  std::unique_ptr<Path> path;
  HandShake shake;
};

void CameraPath::Key::visit(ParamVisitor& v) {
  v.param("time_s", time_s, {"When the camera is there.", "s", 0, 36000});
  v.param("position", position, {"Place, from the working area along the world's axes.", "m"}, 3);
  v.param("look_at", look_at, {"Point looked at, from the working area.", "m"}, 3);
}

void CameraPath::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras or rigs to move.", kNodePattern});
  v.choice("kind", kind, kKinds,
           {"keys: smoothly from key to key; orbit: round a target; follow: beside a target, "
            "wherever it goes; walk: through the free space of the room."});
  v.param("targets", targets,
          {"Nodes to look at, orbit or follow; each camera picks one, and takes the working area "
           "where there is none.",
           kNodePattern});
  v.list("keys", keys, {"Where the camera is when; times ascending."});
  v.param("distance", distance, {"Orbit: distance from the target's centre.", "m", 1e-3, 1e5});
  v.param("polar_angle_deg", polar_angle_deg,
          {"Orbit: angle off the vertical: 0 looks straight down, 90 level.", "deg", 0, 180});
  v.param("azimuth_deg", azimuth_deg,
          {"Orbit: where it begins, round the vertical.", "deg", -360, 360});
  v.param("turn_deg_s", turn_deg_s,
          {"Orbit: how fast it goes round; below 0 clockwise.", "deg/s", -3600, 3600});
  v.param("look_at_offset", look_at_offset,
          {"Orbit: point looked at, from the target's centre.", "m"}, 3);
  v.param("offset", offset,
          {"Follow: place, from the target's centre along the world's axes.", "m"}, 3);
  v.param("lag_s", lag_s,
          {"Follow: how long the camera takes to make up most of what the target is ahead; 0: it "
           "is tied to it.",
           "s", 0, 100});
  v.param("area", area,
          {"Walk: where it may lead, from the working area along the world's axes.", "m"}, 3);
  v.param("speed", speed, {"Walk: speed; less where the way found is short.", "m/s", 0, 100});
  v.choice("look", look, kLooks, {"Walk: at a target, or ahead along the way."});
  v.param("clearance_m", clearance_m,
          {"Walk: nothing visible is nearer, nor what falls as seen from above, however it shakes; "
           "for what comes nearer it waits, or steps back.",
           "m", 0, 100});
  v.param("max_tries", max_tries, {"Walk: draws of a place at most.", "", 1, 100000});
  v.param("jitter_m", jitter_m,
          {"Handheld: root mean square of the way off the path, per axis.", "m", 0, 10});
  v.param("jitter_deg", jitter_deg,
          {"Handheld: root mean square of the turn, per axis.", "deg", 0, 45});
  v.param("jitter_hz", jitter_hz,
          {"Handheld: highest frequency; the lowest is a tenth of it.", "Hz", 0.01, 1000});
}

CameraPath::CameraPath(Params params, Host& host) : params_(std::move(params)), host_(host) {
  if (params_.kind != "keys") return;
  if (params_.keys.empty()) {
    throw Error(ErrorKind::Config,
                "keys: kind 'keys' needs one at least, such as {time_s: 0, position: [2, 0, 1.5]}");
  }
  for (std::size_t i = 1; i < params_.keys.size(); ++i) {
    if (params_.keys[i].time_s > params_.keys[i - 1].time_s) continue;
    throw Error(ErrorKind::Config, "keys[" + std::to_string(i) + "].time_s: expected more than " +
                                       std::to_string(params_.keys[i - 1].time_s) +
                                       ", the time of the key before, found " +
                                       std::to_string(params_.keys[i].time_s));
  }
}

CameraPath::~CameraPath() = default;

std::unique_ptr<CameraPath::Path> CameraPath::draw_walk(const Scene& scene, NodeId node,
                                                        const RandomizeContext& context,
                                                        double shake_m, NodeDraws& draws) const {
  const double clearance_m = params_.clearance_m + reach_of(scene, node) + shake_m;
  const WalkSpace space(scene, clearance_m);
  const double seconds = context.clip ? context.clip->frame_count / context.clip->fps : 0.0;
  const double speed = draws.number(params_.speed);
  const auto draw_place = [&](Rng& rng) -> Vec3 {
    return context.working_area_world + params_.area.draw_vector(rng, draws.index);
  };
  std::vector<Vec3> places =
      plan_walk(space, draw_place, speed * seconds, params_.max_tries, draws.rng.fork("walk"));
  if (places.empty()) {
    Rng first = draws.rng.fork("walk").fork(std::uint64_t(0));
    places = {draw_place(first)};
    host_.log(LogLevel::Warning, scene.path(node) + ": camera_path found no place in its area " +
                                     "that is clear by " + std::to_string(params_.clearance_m) +
                                     " m in " + std::to_string(params_.max_tries) +
                                     " draws; it stays where it may be too near to something");
  }
  auto walk = std::make_unique<Walk>(places);
  walk->things = MovingThings(scene);
  walk->clearance_m = clearance_m;
  walk->speed = seconds > 0.0 ? std::min(speed, walk->curve.length_m() / seconds) : 0.0;
  if (params_.look == "targets") {
    const auto targets = target_centres(scene, params_.targets, context.working_area_world);
    walk->target = targets[draws.rng.fork("target").index(targets.size())];
  }
  return walk;
}

std::unique_ptr<CameraPath::Path> CameraPath::draw_path(const Scene& scene, NodeId node,
                                                        const RandomizeContext& context,
                                                        double shake_m, NodeDraws& draws) const {
  if (params_.kind == "walk") return draw_walk(scene, node, context, shake_m, draws);
  if (params_.kind == "keys") {
    std::vector<KeyCurve::Key> keys;
    for (const Key& key : params_.keys) {
      const Vec3 position = context.working_area_world + draws.vector(key.position);
      const Affine pose = looking(position, context.working_area_world + draws.vector(key.look_at));
      keys.push_back({key.time_s, position, Quat(pose.rotation())});
    }
    return std::make_unique<Keys>(std::move(keys));
  }
  const std::vector<NodeId> targets = scene.match(params_.targets);
  const NodeId target = targets.empty() ? NodeId() : targets[draws.rng.index(targets.size())];
  const Vec3 centre = target ? centre_of(scene, target) : context.working_area_world;
  if (params_.kind == "follow") {
    auto follow = std::make_unique<Follow>();
    follow->target = target;
    follow->centre = centre;
    follow->offset = draws.vector(params_.offset);
    follow->lag_s = params_.lag_s;
    return follow;
  }
  auto orbit = std::make_unique<Orbit>();
  orbit->centre = centre;
  orbit->distance = draws.number(params_.distance);
  orbit->polar = radians(draws.number(params_.polar_angle_deg));
  orbit->azimuth = radians(draws.number(params_.azimuth_deg));
  orbit->turn_s = radians(draws.number(params_.turn_deg_s));
  orbit->look_at = centre + draws.vector(params_.look_at_offset);
  return orbit;
}

void CameraPath::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  moving_.clear();
  const auto draw = [&](NodeId node, NodeDraws& draws) {
    const HandShake shake(params_.jitter_m, radians(params_.jitter_deg), params_.jitter_hz,
                          draws.rng.fork("shake"));
    const double shake_m =
        context.clip ? shake.reach_m(context.clip->frame_count, context.clip->fps) : 0.0;
    moving_.push_back({node, draw_path(scene, node, context, shake_m, draws), shake});
  };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, draw);
  play(scene, context.clip.value_or(ClipFrame()));
}

void CameraPath::play(Scene& scene, const ClipFrame& frame) {
  for (const Moving& moving : moving_) {
    const double time_s = frame.time_s();
    set_world_pose(scene, moving.node, moving.path->pose(scene, time_s) * moving.shake.at(time_s));
  }
}

}  // namespace diorama
