// SPDX-License-Identifier: Apache-2.0
#include "camera_path.h"

#include <cmath>
#include <functional>

#include "camera_curves.h"
#include "diorama/error.h"
#include "diorama/obstacles.h"
#include "framework/pipeline/fake_host.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// A room with a pillar, a thing that falls, and one camera.
struct Hall {
  Hall() {
    const NodeId environment = scene.create(scene.root(), "Environment");
    const auto add = [&](const char* name, const Vec3& half, const Vec3& place) {
      const NodeId node = scene.create(environment, name);
      scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(2.0 * half));
      scene.set_pose(node, Affine(Eigen::Translation3d(place)));
    };
    add("floor", {3, 3, 0.1}, {0, 0, -0.1});
    add("wall_n", {3, 0.1, 1.5}, {0, 3.1, 1.5});
    add("wall_s", {3, 0.1, 1.5}, {0, -3.1, 1.5});
    add("wall_e", {0.1, 3, 1.5}, {3.1, 0, 1.5});
    add("wall_w", {0.1, 3, 1.5}, {-3.1, 0, 1.5});
    add("pillar", {0.5, 0.5, 1.5}, {0, 0, 1.5});
    thing = scene.create(scene.create(scene.root(), "Assets"), "thing");
    scene.edit(thing).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(0.4)));
    scene.edit(thing).rigid_body = RigidBody{};
    scene.set_pose(thing, Affine(Eigen::Translation3d(1.5, 1.5, 2.8)));
    camera = scene.create(scene.create(scene.root(), "Cameras"), "cam_0");
    scene.edit(camera).camera = Camera{};
  }
  /// Poses of the camera in every frame of a clip.
  std::vector<Affine> play(const CameraPath::Params& params, int frames = 60,
                           std::uint64_t seed = 7,
                           const std::function<void(int)>& before_frame = {}) {
    CameraPath path(params, host);
    RandomizeContext context;
    context.moment = "clip";
    context.clip = ClipFrame{0, 0, frames, 30.0};
    path.randomize(scene, context, Rng(seed));
    std::vector<Affine> poses;
    ClipFrame at = *context.clip;
    for (at.frame = 0; at.frame < frames; ++at.frame) {
      if (before_frame) before_frame(at.frame);
      path.play(scene, at);
      poses.push_back(scene.world_from_node(camera));
    }
    return poses;
  }

  FakeHost host;
  Scene scene;
  NodeId thing;
  NodeId camera;
};

CameraPath::Key key_at(double time_s, const Vec3& position, const Vec3& look_at) {
  CameraPath::Key key;
  key.time_s = time_s;
  key.position = position;
  key.look_at = look_at;
  return key;
}

Vec3 forward_of(const Affine& pose) { return -pose.linear().col(2); }

}  // namespace

TEST_CASE("keys are met exactly, and between them speed and turning have no jumps",
          "[randomizers]") {
  std::vector<KeyCurve::Key> keys{{0.0, {0, 0, 0}, Quat::Identity()},
                                  {0.5, {1, 0, 0}, Quat(Eigen::AngleAxisd(0.7, Vec3::UnitZ()))},
                                  {2.0, {1, 2, 0}, Quat(Eigen::AngleAxisd(1.1, Vec3::UnitX()))},
                                  {2.2, {1, 2, 1}, Quat(Eigen::AngleAxisd(-0.4, Vec3::UnitY()))}};
  const KeyCurve curve(keys);
  for (const auto& key : keys) {
    CHECK((curve.pose(key.time_s).translation() - key.position).norm() < 1e-12);
    CHECK(Quat(curve.pose(key.time_s).rotation()).angularDistance(key.rotation) < 1e-6);
  }
  constexpr double kStep = 1e-4;
  const auto velocity = [&](double t) -> Vec3 {
    return (curve.pose(t + kStep).translation() - curve.pose(t).translation()) / kStep;
  };
  const auto turning = [&](double t) -> Vec3 {
    const Eigen::AngleAxisd turn(
        Mat3(curve.pose(t + kStep).rotation() * curve.pose(t).rotation().transpose()));
    return turn.angle() / kStep * turn.axis();
  };
  for (const double t : {0.5, 2.0}) {
    CHECK((velocity(t) - velocity(t - kStep)).norm() < 0.02);
  }
  // Of squad, with equal spans.
  keys[2].time_s = 1.0;
  keys[3].time_s = 1.5;
  const KeyCurve even(keys);
  const auto even_turning = [&](double t) -> Vec3 {
    const Eigen::AngleAxisd turn(
        Mat3(even.pose(t + kStep).rotation() * even.pose(t).rotation().transpose()));
    return turn.angle() / kStep * turn.axis();
  };
  for (const double t : {0.5, 1.0}) {
    CHECK((even_turning(t) - even_turning(t - kStep)).norm() < 0.02);
  }
  CHECK(turning(1.0).norm() > 0.1);
  // It stands still outside.
  CHECK(curve.pose(-1.0).matrix() == curve.pose(0.0).matrix());
  CHECK((curve.pose(9.0).translation() - keys[3].position).norm() < 1e-12);
}

TEST_CASE("an orbit keeps its distance and turns evenly round the target", "[randomizers]") {
  Hall hall;
  CameraPath::Params params;
  params.distance = 1.2;
  params.polar_angle_deg = 60.0;
  params.turn_deg_s = 45.0;
  const auto poses = hall.play(params);
  const Vec3 target(1.5, 1.5, 2.8);
  for (const Affine& pose : poses) {
    CHECK(std::abs((pose.translation() - target).norm() - 1.2) < 1e-9);
    CHECK(forward_of(pose).dot((target - pose.translation()).normalized()) > 1.0 - 1e-9);
  }
  const double flat = 1.2 * std::sin(60.0 * kPi / 180.0);
  const double chord = 2.0 * flat * std::sin(0.5 * 1.5 * kPi / 180.0);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    CHECK(std::abs((poses[i].translation() - poses[i - 1].translation()).norm() - chord) < 1e-9);
  }
}

TEST_CASE("who follows keeps the target in the middle and lags behind it", "[randomizers]") {
  Hall hall;
  const auto fall = [&](int frame) {
    hall.scene.set_pose(hall.thing,
                        Affine(Eigen::Translation3d(1.5, 1.5, 2.8 - 1.0 * frame / 30.0)));
  };
  CameraPath::Params params;
  params.kind = "follow";
  params.offset = Vec3(-1.0, 0.0, 0.5);
  params.lag_s = 0.0;
  const auto tied = hall.play(params, 60, 7, fall);
  for (int i = 0; i < 60; ++i) {
    const Vec3 expected(0.5, 1.5, 3.3 - i / 30.0);
    CHECK((tied[std::size_t(i)].translation() - expected).norm() < 1e-9);
  }
  fall(0);
  params.lag_s = 0.2;
  const auto towed = hall.play(params, 60, 7, fall);
  // At one metre a second it comes to be lag_s metres behind, less what a frame makes up.
  CHECK(towed.front().translation() == tied.front().translation());
  const double behind = towed.back().translation().z() - tied.back().translation().z();
  CHECK(behind > 0.17);
  CHECK(behind < 0.21);
}

TEST_CASE("who walks keeps clear of walls, pillars and what may fall, at one speed",
          "[randomizers]") {
  Hall hall;
  CameraPath::Params params;
  params.kind = "walk";
  params.area = Distribution::between(Vec3(-2.9, -2.9, 1.2), Vec3(2.9, 2.9, 1.7));
  params.speed = 1.0;
  params.look = "ahead";
  params.max_tries = 3000;
  const Obstacles obstacles(hall.scene, "/Environment/**");
  int long_ones = 0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const auto poses = hall.play(params, 90, seed);
    double walked = 0.0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Vec3 place = poses[i].translation();
      CHECK(obstacles.distance(place, 1.0) >= 0.3);
      CHECK((place - Vec3(1.5, 1.5, place.z())).head<2>().cwiseAbs().maxCoeff() >= 0.2 + 0.2);
      if (i == 0) continue;
      const Vec3 step = place - poses[i - 1].translation();
      walked += step.norm();
      CHECK(step.norm() < 1.0 / 30.0 + 1e-9);
      CHECK_FALSE(obstacles.is_between(poses[i - 1].translation(), place));
      // It looks where it goes, and turns little by little.
      CHECK(forward_of(poses[i]).dot(forward_of(poses[i - 1])) > 0.9);
      if (step.norm() > 0.01) CHECK(forward_of(poses[i]).dot(step.normalized()) > 0.7);
    }
    if (walked > 2.5) ++long_ones;
  }
  CHECK(long_ones >= 5);
}

TEST_CASE("a hand that shakes brings nobody who walks nearer to anything", "[randomizers]") {
  Hall hall;
  CameraPath::Params params;
  params.kind = "walk";
  params.area = Distribution::between(Vec3(-2.9, -2.9, 1.2), Vec3(2.9, 2.9, 1.7));
  params.speed = 1.5;
  params.clearance_m = 0.2;
  params.jitter_m = 0.06;
  params.jitter_hz = 9.0;
  params.max_tries = 3000;
  const Obstacles obstacles(hall.scene, "/Environment/**");
  double nearest = 1.0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    for (const Affine& pose : hall.play(params, 90, seed)) {
      nearest = std::min(nearest, obstacles.distance(pose.translation(), 1.0));
    }
  }
  CHECK(nearest >= 0.2);
}

TEST_CASE("who walks waits for what crosses the way, and steps back from it", "[randomizers]") {
  int met = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Hall hall;
    CameraPath::Params params;
    params.kind = "walk";
    params.area = Distribution::between(Vec3(-2.9, -2.9, 1.5), Vec3(2.9, 2.9, 1.5));
    params.speed = 0.8;
    params.max_tries = 3000;
    hall.scene.edit(hall.thing).rigid_body->has_gravity = false;
    const Affine far_off(Eigen::Translation3d(0, 0, 9));
    hall.scene.set_pose(hall.thing, far_off);
    const auto alone = hall.play(params, 90, seed);
    const Vec3 there = alone[45].translation();
    if ((alone.front().translation() - there).norm() < 0.9) continue;
    // It comes down to where the walk would be after one and a half seconds, and goes up again.
    const auto fly = [&](int frame) {
      const double height = 0.02 * std::abs(frame - 45);
      hall.scene.set_pose(hall.thing, Affine(Eigen::Translation3d(there + Vec3(0, 0, height))));
    };
    const auto nearest = [&](const std::vector<Affine>& poses) {
      double distance = 9.0;
      for (int frame = 1; frame < 90; ++frame) {
        fly(frame);
        const Aabb box = hall.scene.world_bounds(hall.thing);
        const Vec3 place = poses[std::size_t(frame)].translation();
        const Vec3 off = (box.min - place).cwiseMax(place - box.max).cwiseMax(0.0);
        distance = std::min(distance, off.norm());
      }
      return distance;
    };
    hall.scene.set_pose(hall.thing, far_off);
    const auto careful = hall.play(params, 90, seed, [&](int frame) {
      if (frame > 0) fly(frame);
    });
    CAPTURE(seed);
    CHECK(nearest(alone) == 0.0);
    CHECK(nearest(careful) > 0.2);
    ++met;
  }
  CHECK(met >= 3);
}

TEST_CASE("where there is no room to walk it is said, and the camera stands", "[randomizers]") {
  Hall hall;
  CameraPath::Params params;
  params.kind = "walk";
  params.area = Distribution::between(Vec3(-0.4, -0.4, 1.0), Vec3(0.4, 0.4, 2.0));
  params.max_tries = 50;
  const auto poses = hall.play(params);
  CHECK(poses.front().translation() == poses.back().translation());
  REQUIRE(hall.host.warnings.size() == 1);
  CHECK_THAT(hall.host.warnings.front(),
             ContainsSubstring("/Cameras/cam_0: camera_path found no place in its area"));
}

TEST_CASE("a hand shakes as much as is said, slowly, and the same every time", "[randomizers]") {
  const HandShake shake(0.01, 0.02, 3.0, Rng(5));
  double sum = 0.0;
  double fastest = 0.0;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3 place = shake.at(0.01 * i).translation();
    sum += place.squaredNorm() / 3.0;
    fastest = std::max(fastest, (shake.at(0.01 * i + 0.001).translation() - place).norm() / 0.001);
  }
  CHECK(std::abs(std::sqrt(sum / kSamples) - 0.01) < 0.001);
  // Eight waves of at most 3 Hz on each of three axes.
  CHECK(fastest < 0.01 * std::sqrt(2.0 / 8.0) * 8.0 * 2.0 * kPi * 3.0 * std::sqrt(3.0));
  Hall hall;
  CameraPath::Params params;
  params.jitter_m = 0.01;
  params.jitter_deg = 1.0;
  const auto first = hall.play(params);
  const auto again = hall.play(params);
  const auto other = hall.play(params, 60, 8);
  for (std::size_t i = 0; i < first.size(); ++i) CHECK(first[i].matrix() == again[i].matrix());
  CHECK(first[9].matrix() != other[9].matrix());
}

TEST_CASE("keys that go back in time are refused", "[randomizers]") {
  FakeHost host;
  CameraPath::Params params;
  params.kind = "keys";
  CHECK_THROWS_WITH(CameraPath(params, host), ContainsSubstring("keys: kind 'keys' needs one"));
  params.keys = {key_at(1.0, {0, 0, 1}, {1, 0, 1}), key_at(0.5, {0, 1, 1}, {1, 0, 1})};
  CHECK_THROWS_WITH(CameraPath(params, host),
                    ContainsSubstring("keys[1].time_s: expected more than 1.0"));
}
