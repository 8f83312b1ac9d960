// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/settling.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "support/catch.h"

using namespace diorama;

namespace {

/// A room of 4 x 2 x 3 m whose floor is at z = 0, with objects at the given places.
struct RoomStage {
  explicit RoomStage(const std::vector<Vec3>& places) {
    environment = scene.create(scene.create(scene.root(), "Environment"), "room");
    scene.edit(environment).mesh = std::make_shared<const Mesh>(make_box(Vec3(4, 2, 3)));
    scene.set_pose(environment, Affine(Eigen::Translation3d(0, 0, 1.5)));
    const NodeId assets = scene.create(scene.root(), "Assets");
    for (const Vec3& place : places) {
      const NodeId object = scene.create(assets, "mug");
      scene.set_pose(object, Affine(Eigen::Translation3d(place)));
      scene.edit(object).rigid_body = RigidBody{};
      objects.push_back(object);
    }
  }
  Scene scene;
  NodeId environment;
  std::vector<NodeId> objects;
};

}  // namespace

TEST_CASE("A room holds what is within its walls and above its floor, however high", "[settle]") {
  const RoomStage stage({{1.9, 0.9, 0.1}, {2.1, 0, 1}, {0, -1.1, 1}, {0, 0, -0.5}, {0, 0, 50}});
  const Room room(stage.scene, stage.environment);
  std::vector<bool> held;
  for (const NodeId object : stage.objects) held.push_back(room.holds(stage.scene, object));
  CHECK(held == std::vector<bool>{true, false, false, false, true});
}

TEST_CASE("An environment without meshes has no outside", "[settle]") {
  RoomStage stage({{100, 100, -100}});
  stage.scene.edit(stage.environment).mesh.reset();
  CHECK(Room(stage.scene, stage.environment).holds(stage.scene, stage.objects[0]));
}

TEST_CASE("Hidden geometry does not make a room larger", "[settle]") {
  RoomStage stage({{5, 0, 1}, {1, 0, 1}});
  const NodeId guide = stage.scene.create(stage.environment, "guide");
  stage.scene.edit(guide).mesh = std::make_shared<const Mesh>(make_box(Vec3(20, 30, 40)));
  stage.scene.edit(guide).is_visible = false;
  const Room room(stage.scene, stage.environment);
  CHECK_FALSE(room.holds(stage.scene, stage.objects[0]));
  CHECK(room.holds(stage.scene, stage.objects[1]));
}

TEST_CASE("The fastest object is one that falls, in the room", "[settle]") {
  RoomStage stage({{0, 0, 1}, {1, 0, 1}, {9, 0, 1}, {-1, 0, 1}});
  const auto set_speed = [&](std::size_t object, double speed, bool has_gravity) {
    RigidBody& body = *stage.scene.edit(stage.objects[object]).rigid_body;
    body.linear_velocity = Vec3(0, speed, 0);
    body.has_gravity = has_gravity;
  };
  set_speed(0, 0.2, true);
  set_speed(1, 7.0, false);
  set_speed(2, 9.0, true);  // outside
  const Room room(stage.scene, stage.environment);
  CHECK(fastest_falling(stage.scene, room, stage.objects, {{}, 0.0}) == 0.2);
  // Pushed by 10 mm in 20 ms, which left no velocity.
  BodyPoses before = body_poses(stage.scene);
  before.at(stage.objects[3]).translation().x() += 0.01;
  CHECK(fastest_falling(stage.scene, room, stage.objects, {before, 0.02}) == Approx(0.5));
  // It was placed since.
  before.erase(stage.objects[3]);
  CHECK(fastest_falling(stage.scene, room, stage.objects, {before, 0.02}) == 0.2);
}

namespace {

/// Plays a simulation of 10 s in 60 steps a second, looked at as often as a visit does; `place_at`
/// is where object 0 is. The time at which nothing but jitter was left; below 0: never.
template <class PlaceAt>
double jitters_from(RoomStage& stage, const PlaceAt& place_at) {
  constexpr double kStepS = 1 / 60.0;
  const Room room(stage.scene, stage.environment);
  JitterWatch watch;
  for (int step = 5; step <= 600; step += 5) {
    const double now = step * kStepS;
    stage.scene.set_pose(stage.objects[0], Affine(Eigen::Translation3d(place_at(now - kStepS))));
    const BodyPoses before = body_poses(stage.scene);
    stage.scene.set_pose(stage.objects[0], Affine(Eigen::Translation3d(place_at(now))));
    watch.look(stage.scene, room, stage.objects, {before, kStepS}, 0.05, now);
    if (watch.only_jitter_is_left(now)) return now;
  }
  return -1.0;
}

}  // namespace

TEST_CASE("What moves to and fro in place is not waited for, what gets somewhere is", "[settle]") {
  // 17 mm wide, faster than 5 cm/s nearly all the time.
  const auto jitter = [](double t) { return Vec3(0, 0.0085 * std::sin(60.0 * t), 0.1); };
  SECTION("jitter") {
    RoomStage stage({{0, 0, 1}, {1, 0, 1}});
    CHECK(jitters_from(stage, jitter) == Approx(1.5).margin(0.3));
  }
  SECTION("something that is shaken") {
    RoomStage stage({{0, 0, 1}});
    const auto shaken = [](double t) { return Vec3(0.025 * std::sin(20.0 * t), 0, 0.1); };
    CHECK(jitters_from(stage, shaken) == Approx(1.8).margin(0.4));
  }
  SECTION("a ball that rolls to and fro in a bowl for a while") {
    RoomStage stage({{0, 0, 1}});
    const auto rolls = [](double t) {
      return Vec3(0.05 * std::exp(-t) * std::sin(9.0 * t), 0, 0.1);
    };
    CHECK(jitters_from(stage, rolls) < 0.0);
  }
  SECTION("jitter after a fall") {
    RoomStage stage({{0, 0, 1}});
    const double end =
        jitters_from(stage, [&](double t) { return t < 1.5 ? Vec3(0, 0, 1.6 - t) : jitter(t); });
    CHECK(end == Approx(3.0).margin(0.3));
  }
  SECTION("jitter outside the room, and of what floats") {
    RoomStage outside({{0, 0, 1}});
    CHECK(jitters_from(outside, [&](double t) { return Vec3(jitter(t) + Vec3(9, 0, 0)); }) < 0.0);
    RoomStage floating({{0, 0, 1}});
    floating.scene.edit(floating.objects[0]).rigid_body->has_gravity = false;
    CHECK(jitters_from(floating, jitter) < 0.0);
  }
  SECTION("a slow roll") {
    RoomStage stage({{0, 0, 1}});
    CHECK(jitters_from(stage, [](double t) { return Vec3(-1 + 0.06 * t, 0, 0.1); }) < 0.0);
  }
  SECTION("rest, with a push now and then") {
    RoomStage stage({{0, 0, 1}});
    CHECK(jitters_from(stage, [&](double t) {
            return std::fmod(t, 1.0) < 0.5 ? jitter(t) : Vec3(0, 0, 0.1);
          }) < 0.0);
  }
  SECTION("another thing is still under way") {
    RoomStage stage({{0, 0, 1}, {1, 0, 2.5}});
    RigidBody& body = *stage.scene.edit(stage.objects[1]).rigid_body;
    double height = 2.5;
    const double end = jitters_from(stage, [&](double t) {
      height -= t < 6.0 ? 0.006 : 0.0;
      stage.scene.set_pose(stage.objects[1], Affine(Eigen::Translation3d(1, 0, height)));
      body.linear_velocity = Vec3(0, 0, t < 6.0 ? -0.4 : 0.0);
      return jitter(t);
    });
    CHECK(end == Approx(6.25).margin(0.3));
  }
}

TEST_CASE("Things are named where they stay, once, until they move on", "[settle]") {
  RoomStage stage({{0, 0, 1}, {1, 0, 1}, {9, 0, 1}, {-1, 0, 1}});
  stage.scene.edit(stage.objects[3]).rigid_body->has_gravity = false;
  const Room room(stage.scene, stage.environment);
  PlaceWatch watch;
  const auto move = [&](const Vec3& to) {
    stage.scene.set_pose(stage.objects[0], Affine(Eigen::Translation3d(to)));
  };
  const auto look = [&] { return watch.settled_since(stage.scene, room, stage.objects); };
  CHECK(look().empty());
  move({0, 0, 0.5});  // It falls; the others, but one outside and one that floats, stay.
  CHECK(look() == std::vector<NodeId>{stage.objects[1]});
  move({0.015, 0, 0.5});
  CHECK(look() == std::vector<NodeId>{stage.objects[0]});
  CHECK(look().empty());
  move({0.0195, 0, 0.5});  // Not where it was named.
  CHECK(look() == std::vector<NodeId>{stage.objects[0]});
  move({0.5, 0, 0.5});
  CHECK(look().empty());
}

TEST_CASE("Saved nodes come back as they were, all others stay as they are", "[settle]") {
  RoomStage stage({{0, 0, 1}, {1, 0, 1}});
  Scene& scene = stage.scene;
  const NodeId lamp = scene.create(scene.root(), "lamp");
  scene.edit(lamp).light = Light{};
  const SavedNodes saved(scene, {stage.objects[1]});
  const Affine moved(Eigen::Translation3d(0.5, 0.25, 2));
  for (const NodeId object : stage.objects) {
    scene.set_pose(object, moved);
    scene.edit(object).labels["class"] = "cup";
  }
  scene.edit(lamp).light->radius_m = 5.0;
  scene.edit(stage.environment).is_visible = false;
  saved.restore(scene);
  CHECK(scene.world_from_node(stage.objects[0]).translation() == Vec3(0, 0, 1));
  CHECK(scene[stage.objects[0]].labels.empty());
  CHECK(scene[lamp].light->radius_m == Light{}.radius_m);
  CHECK(scene[stage.environment].is_visible);
  CHECK(scene.world_from_node(stage.objects[1]).matrix() == moved.matrix());
  CHECK(scene[stage.objects[1]].labels.at("class") == "cup");
}

TEST_CASE("The report names the worst visits and every object that left", "[settle]") {
  VisitReport quiet;
  quiet.falling_objects = 5;
  quiet.simulated_s = 3.4;
  quiet.rest_after_s = 1.25;
  quiet.max_penetration_m = 0.002;
  quiet.deepest_body = "/Assets/bowl";
  VisitReport wild;
  wild.visit = 1;
  wild.environment = "room.usdc";
  wild.falling_objects = 6;
  wild.simulated_s = 3.4;
  wild.max_speed = 0.5;
  wild.left_room = {"/Assets/mug"};
  wild.born_inside = {{"/Assets/egg", "starts in /Environment/lamp"}};
  wild.respawned = {{"/Assets/can", "left the room"}, {"/Assets/can", "moves at 0.20 m/s"}};
  wild.dropped = {{"/Assets/pot", "hangs in the air"}};
  wild.unsettled = {{"/Assets/mug", "left the room"}};
  wild.cameras = {{"/Cameras/cam_0", "stands in /Environment/lamp"}};
  const auto text_of = [](const std::vector<VisitReport>& visits) {
    SettleSummary summary;
    for (const VisitReport& visit : visits) summary.add(visit);
    CHECK(summary.visit_count() == int(visits.size()));
    return summary.text();
  };
  CHECK(text_of({}).empty());
  const std::string text = text_of({quiet, wild});
  CHECK_THAT(text, ContainsSubstring("11 falling over all visits, 1 left the room"));
  CHECK_THAT(text, ContainsSubstring("at rest after at most 1.25 s (visit 1)"));
  CHECK_THAT(text, ContainsSubstring("residual speed at most 0.5000 m/s (visit 2)"));
  CHECK_THAT(text, ContainsSubstring("deepest penetration 2.00 mm (visit 1, /Assets/bowl)"));
  CHECK_THAT(text, ContainsSubstring("visit 2: not at rest after 3.40 s"));
  CHECK_THAT(text, ContainsSubstring("visit 2: /Assets/mug left the room"));
  CHECK_THAT(text, ContainsSubstring("visit 2: /Assets/can left the room, so it was placed anew"));
  CHECK_THAT(text, ContainsSubstring("visit 2: /Assets/pot hangs in the air, so it was taken out"));
  CHECK_THAT(text, ContainsSubstring("visit 2: /Assets/egg starts in /Environment/lamp\n"));
  CHECK_THAT(text, ContainsSubstring("visit 2: /Cameras/cam_0 stands in /Environment/lamp\n"));
  VisitReport terrible;
  for (int i = 0; i < 100; ++i) terrible.dropped.push_back({"/Assets/a", "hangs in the air"});
  CHECK_THAT(text_of({terrible}), ContainsSubstring("... and 61 more, in settle/\n"));
  const auto json = nlohmann::json::parse(settle_json(wild));
  CHECK(json["rest_after_s"].is_null());
  CHECK(json["environment"] == "room.usdc");
  CHECK(json["respawned"].size() == 2);
  CHECK(json["respawned"][1]["why"] == "moves at 0.20 m/s");
  CHECK(json["dropped"][0]["object"] == "/Assets/pot");
  CHECK(json["unsettled"][0]["why"] == "left the room");
  CHECK(json["born_inside"].size() == 1);
  CHECK(json["blocked_cameras"][0]["camera"] == "/Cameras/cam_0");
  CHECK(nlohmann::json::parse(settle_json(quiet))["rest_after_s"] == 1.25);
}
