// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "animation_time.h"
#include "framework/pipeline/fake_host.h"
#include "joint_positions.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

struct Cabinet {
  Scene scene;
  FakeHost host;
  NodeId body = scene.create(scene.root(), "body");
  NodeId drawer = scene.create(scene.root(), "drawer");
  NodeId door = scene.create(scene.root(), "door");
  NodeId wheel = scene.create(scene.root(), "wheel");
  NodeId slide = add("slide", JointKind::Prismatic, drawer, 0.05, 0.4);
  NodeId hinge = add("hinge", JointKind::Revolute, door, -0.5, 1.0);
  NodeId spin = add("spin", JointKind::Revolute, wheel, -kInfinity, kInfinity);

  NodeId add(const char* name, JointKind kind, NodeId child, double lower, double upper) {
    const NodeId id = scene.create(scene.root(), name);
    Joint joint;
    joint.kind = kind;
    joint.parent_body = body;
    joint.child_body = child;
    joint.lower = lower;
    joint.upper = upper;
    scene.edit(id).joint = joint;
    return id;
  }
};

}  // namespace

TEST_CASE("joints are drawn all over the range of their limits", "[randomizers]") {
  Cabinet cabinet;
  JointPositions positions({}, cabinet.host);
  std::vector<double> slides, hinges, spins;
  for (int seed = 0; seed < kSeeds; ++seed) {
    positions.randomize(cabinet.scene, {}, Rng(std::uint64_t(seed)));
    slides.push_back(joint_position(cabinet.scene, cabinet.slide));
    hinges.push_back(joint_position(cabinet.scene, cabinet.hinge));
    spins.push_back(joint_position(cabinet.scene, cabinet.spin));
  }
  CHECK(fills(slides, 0.05 - 1e-9, 0.4 + 1e-9));
  CHECK(fills(hinges, -0.5 - 1e-9, 1.0 + 1e-9));
  CHECK(fills(spins, -kPi, kPi));
}

TEST_CASE("joints are moved by pattern, by chance, and to positions in degrees and metres",
          "[randomizers]") {
  Cabinet cabinet;
  JointPositions::Params params;
  params.joints = {"/slide", "/hinge"};
  params.angle_deg = Distribution(30.0);
  params.distance_m = Distribution(7.0);
  JointPositions positions(params, cabinet.host);
  positions.randomize(cabinet.scene, {}, Rng(1));
  CHECK(joint_position(cabinet.scene, cabinet.hinge) == Approx(kPi / 6.0));
  CHECK(joint_position(cabinet.scene, cabinet.slide) == Approx(0.4));
  CHECK(joint_position(cabinet.scene, cabinet.spin) == 0.0);
  params.moved_chance = 0.0;
  params.angle_deg = Distribution(0.0);
  JointPositions none(params, cabinet.host);
  none.randomize(cabinet.scene, {}, Rng(1));
  CHECK(joint_position(cabinet.scene, cabinet.hinge) == Approx(kPi / 6.0));
}

TEST_CASE("one more joint leaves the draws of the others as they were", "[randomizers]") {
  Cabinet one, two;
  two.add("another", JointKind::Prismatic, two.wheel, 0.0, 1.0);
  for (Cabinet* cabinet : {&one, &two}) {
    JointPositions({}, cabinet->host).randomize(cabinet->scene, {}, Rng(5));
  }
  CHECK(joint_position(one.scene, one.hinge) == joint_position(two.scene, two.hinge));
}

TEST_CASE("an animated asset is shown at a time of its animation", "[randomizers]") {
  Scene scene;
  FakeHost host;
  const auto mesh = [](double size) {
    return std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
  };
  const auto build = [&](double seconds) {
    return [&mesh, seconds](Scene& made, NodeId root) {
      made.edit(root).animation = Animation{"fan.usd", 1.0, 3.0};
      const NodeId blade = made.create(root, "blade");
      made.edit(blade).mesh = mesh(1.0 + seconds);
      made.set_pose(blade, Affine(Eigen::Translation3d(seconds, 0, 0)));
      const NodeId weight = made.create(root, "weight");
      made.edit(weight).rigid_body = RigidBody{};
      made.set_pose(weight, Affine(Eigen::Translation3d(0, seconds, 0)));
    };
  };
  host.assets["fan.usd"] = build(0.0);
  host.assets["fan.usd{time=2.5}"] = build(2.5);
  const NodeId object = scene.create(scene.root(), "object");
  const NodeId fan = host.load_asset("fan.usd", scene, object);
  scene.set_pose(object, Affine(Eigen::Translation3d(0, 0, 9)));
  AnimationTime::Params params;
  params.time_s = Distribution(2.4);
  params.frames_per_second = 2.0;
  AnimationTime(params, host).randomize(scene, {}, Rng(3));
  const NodeId blade = scene.require(scene.path(fan) + "/blade");
  CHECK(scene[blade].mesh->bounds().size().x() == Approx(3.5));
  CHECK((scene.world_from_node(blade).translation() - Vec3(2.5, 0, 9)).norm() < 1e-12);
  // The simulation has that one.
  const NodeId weight = scene.require(scene.path(fan) + "/weight");
  CHECK(scene[weight].parent_from_node.translation().y() == 0.0);
  // Times beyond the end are the end.
  host.assets["fan.usd{time=3}"] = build(3.0);
  params.time_s = Distribution(50.0);
  AnimationTime(params, host).randomize(scene, {}, Rng(3));
  CHECK(scene[blade].mesh->bounds().size().x() == Approx(4.0));
}

TEST_CASE("an animation is drawn among those of the file", "[randomizers]") {
  FakeHost host;
  const auto build = [&](const std::string& asset, double end, double size) {
    return [asset, end, size](Scene& made, NodeId root) {
      made.edit(root).animation = Animation{asset, 0.0, end};
      made.edit(root).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
    };
  };
  host.assets["man.glb"] = build("man.glb", 4.0, 1.0);
  host.assets["man.glb{animation=run}"] = build("man.glb{animation=run}", 2.0, 1.0);
  host.assets["man.glb{animation=run}{time=1}"] = build("man.glb{animation=run}", 2.0, 5.0);
  host.assets["man.glb{animation=jump}"] = build("man.glb{animation=jump}", 1.0, 1.0);
  host.assets["man.glb{animation=jump}{time=0.5}"] = build("man.glb{animation=jump}", 1.0, 7.0);
  host.assets["man.glb{animation=still}"] = [](Scene&, NodeId) {};
  Scene scene;
  const NodeId man = host.load_asset("man.glb", scene, scene.root());
  const auto show = [&](const std::vector<std::string>& words, int seed) {
    AnimationTime::Params params;
    params.animation = TextDistribution(words);
    params.share = Distribution(0.5);
    AnimationTime(params, host).randomize(scene, {}, Rng(std::uint64_t(seed)));
    return scene[man].mesh->bounds().size().x();
  };
  CHECK(show({"run"}, 1) == Approx(5.0));
  CHECK(scene[man].animation->asset == "man.glb{animation=run}");
  CHECK(scene[man].animation->end_s == 2.0);
  // From one to another.
  CHECK(show({"jump"}, 1) == Approx(7.0));
  CHECK(scene[man].animation->asset == "man.glb{animation=jump}");
  std::set<double> sizes;
  for (int seed = 0; seed < 20; ++seed) sizes.insert(std::round(show({"run", "jump"}, seed)));
  CHECK(sizes == std::set<double>{5.0, 7.0});
  CHECK_THROWS_WITH(show({"still"}, 1), "man.glb{animation=still}: does not move");
  // What the name chose stays chosen.
  Scene other;
  const NodeId runner = host.load_asset("man.glb{animation=run}", other, other.root());
  AnimationTime::Params params;
  params.share = Distribution(0.5);
  AnimationTime(params, host).randomize(other, {}, Rng(3));
  CHECK(other[runner].mesh->bounds().size().x() == Approx(5.0));
  // How long it lasts is learnt once, however many visits show it.
  int looks = 0;
  const auto run = build("man.glb{animation=run}", 2.0, 1.0);
  host.assets["man.glb{animation=run}"] = [&](Scene& made, NodeId root) {
    ++looks;
    run(made, root);
  };
  params.animation = TextDistribution(std::vector<std::string>{"run"});
  AnimationTime player(params, host);
  for (int visit = 0; visit < 3; ++visit) {
    Scene room;
    const NodeId node = host.load_asset("man.glb", room, room.root());
    player.randomize(room, {}, Rng(3));
    CHECK(room[node].animation->end_s == 2.0);
    CHECK(room[node].mesh->bounds().size().x() == Approx(5.0));
  }
  CHECK(looks == 1);
}

TEST_CASE("in a clip an animated asset goes on from the time that was drawn", "[randomizers]") {
  FakeHost host;
  Scene scene;
  const auto still = std::make_shared<const Mesh>(make_box(Vec3::Constant(9.0)));
  std::vector<double> loaded;
  const auto build = [&](double seconds) {
    return [&, seconds](Scene& made, NodeId root) {
      loaded.push_back(seconds);
      made.edit(root).animation = Animation{"fan.usd", 1.0, 3.0};
      const NodeId blade = made.create(root, "blade");
      made.edit(blade).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(1.0 + seconds)));
      // Equal at all times, and made anew each time.
      made.edit(made.create(root, "post")).mesh = std::make_shared<const Mesh>(*still);
    };
  };
  for (const double time : {1.0, 1.5, 2.0, 2.5, 3.0}) {
    std::string name = std::to_string(time);
    name.erase(name.find_last_not_of('0') + 1);
    if (name.ends_with('.')) name.pop_back();
    host.assets["fan.usd{time=" + name + "}"] = build(time);
  }
  host.assets["fan.usd"] = build(1.0);
  const NodeId fan = host.load_asset("fan.usd", scene, scene.root());
  const NodeId blade = scene.require(scene.path(fan) + "/blade");
  const NodeId post = scene.require(scene.path(fan) + "/post");

  const auto times = [&](const std::string& at_end, double speed) {
    AnimationTime::Params params;
    params.time_s = Distribution(2.0);
    params.speed = Distribution(speed);
    params.at_end = at_end;
    AnimationTime player(params, host);
    RandomizeContext context;
    context.clip = ClipFrame{0, 0, 6, 2.0};
    player.randomize(scene, context, Rng(3));
    const auto post_mesh = scene[post].mesh;
    std::string text;
    for (ClipFrame at = *context.clip; at.frame < 6; ++at.frame) {
      if (at.frame > 0) player.lead(scene, at);
      const double time = scene[blade].mesh->bounds().size().x() - 1.0;
      text += (text.empty() ? "" : " ") + std::to_string(time).substr(0, 3);
      CHECK(scene[post].mesh == post_mesh);
    }
    return text;
  };
  CHECK(times("repeat", 1.0) == "2.0 2.5 1.0 1.5 2.0 2.5");
  CHECK(times("ping_pong", 1.0) == "2.0 2.5 3.0 2.5 2.0 1.5");
  CHECK(times("hold", 1.0) == "2.0 2.5 3.0 3.0 3.0 3.0");
  CHECK(times("repeat", -1.0) == "2.0 1.5 1.0 2.5 2.0 1.5");
  CHECK(times("hold", -2.0) == "2.0 1.0 1.0 1.0 1.0 1.0");
  loaded.clear();
  CHECK(times("repeat", 0.0) == "2.0 2.0 2.0 2.0 2.0 2.0");
  CHECK(loaded.size() == 1);
}
