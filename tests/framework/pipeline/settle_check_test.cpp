// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/settle_check.h"

#include <cmath>
#include <cstdint>

#include "framework/pipeline/physics_view.h"
#include "framework/pipeline/settling.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

/// A room of 8 x 8 x 3 m with its floor at z = 0, and a table of 1 x 1 x 0.7 m at the origin.
struct FurnishedRoom {
  FurnishedRoom() {
    environment = scene.create(scene.root(), "Environment");
    Mesh walls = make_box(Vec3(8, 8, 3));
    for (auto& [a, b, c] : walls.triangles) std::swap(b, c);  // faces look inwards
    add(environment, "walls", walls, at(0, 0, 1.5));
    table = add(environment, "table", make_box(Vec3(1, 1, 0.7)), at(0, 0, 0.35));
    assets = scene.create(scene.root(), "Assets");
  }
  NodeId add(NodeId parent, const std::string& name, const Mesh& mesh, const Affine& pose) {
    const NodeId node = scene.create(parent, name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, pose);
    return node;
  }
  NodeId add_object(const std::string& name, const Mesh& mesh, const Affine& pose,
                    bool has_gravity = true) {
    const NodeId node = add(assets, name, mesh, pose);
    scene.edit(node).rigid_body = RigidBody{};
    scene.edit(node).rigid_body->has_gravity = has_gravity;
    objects.push_back(node);
    return node;
  }
  /// "name: why", in order.
  std::vector<std::string> unsettled(const LastStep& last = {{}, 0.0}) const {
    std::vector<std::string> texts;
    for (const Flaw& flaw : find_unsettled(scene, Room(scene, environment), objects, last, {})) {
      texts.push_back(scene[flaw.node].name + ": " + flaw.why);
    }
    return texts;
  }

  Scene scene;
  NodeId environment, table, assets;
  std::vector<NodeId> objects;
};

const Mesh kBox = make_box(Vec3(0.2, 0.2, 0.2));
using Texts = std::vector<std::string>;

}  // namespace

TEST_CASE("What lies on the table, on the floor or on what lies there is settled", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("on_table", kBox, at(0.2, 0.1, 0.8));
  stage.add_object("on_box", make_sphere(0.1), at(0.2, 0.1, 1.0));
  stage.add_object("on_floor", kBox, at(2, 1, 0.1));
  // 5 mm above or in what it lies on, as engines leave things.
  stage.add_object("skin", kBox, at(-0.2, -0.2, 0.805));
  stage.add_object("dent", kBox, at(-2, 1, 0.095));
  CHECK(stage.unsettled() == Texts{});
}

TEST_CASE("What hangs, moves, is outside or sticks is named with the reason", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("in_air", kBox, at(0, 0, 1.2));
  const NodeId rolls = stage.add_object("rolls", make_sphere(0.1), at(2, 0, 0.1));
  stage.scene.edit(rolls).rigid_body->linear_velocity = Vec3(0.3, 0, 0);
  stage.add_object("gone", kBox, at(0, 0, -3));
  const NodeId half_in = stage.add_object("half_in", kBox, at(0.3, 0.3, 0.7));
  const NodeId inside = stage.add_object("inside", make_sphere(0.05), at(0, 0, 0.35));
  const auto stuck = [&](const std::vector<NodeId>& asked) {
    std::vector<NodeId> nodes;
    for (const Flaw& flaw : find_stuck(stage.scene, stage.objects, asked, {})) {
      nodes.push_back(flaw.node);
    }
    return nodes;
  };
  CHECK(stuck(stage.objects) == std::vector<NodeId>{half_in, inside});
  CHECK(stuck({rolls, inside}) == std::vector<NodeId>{inside});
  CHECK(stuck({}).empty());
  CHECK(stage.unsettled() == Texts{"in_air: hangs in the air", "rolls: moves at 0.30 m/s",
                                   "gone: left the room", "half_in: is stuck in /Environment/table",
                                   "inside: is stuck in /Environment/table"});
}

TEST_CASE("What has sunk in by more than a centimetre is stuck", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("sunk", kBox, at(0.2, 0.1, 0.787));
  stage.add_object("pressed", kBox, at(-0.2, 0.1, 0.793));
  CHECK(stage.unsettled() == Texts{"sunk: is stuck in /Environment/table"});
}

TEST_CASE("A wide thing that is sunk in with one corner alone is stuck", "[settle]") {
  FurnishedRoom stage;
  const Mesh board = make_box(Vec3(0.8, 0.8, 0.03));
  const auto tilted = Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Vec3(1, -1, 0).normalized()));
  const double low = 0.4 * std::sqrt(2.0) * std::sin(0.2) + 0.015 * std::cos(0.2);
  stage.add_object("stands", board, at(0, 0, 0.7 + low - 0.002) * tilted);
  CHECK(stage.unsettled() == Texts{});
  stage.scene.set_pose(stage.objects[0], at(0, 0, 0.7 + low - 0.025) * tilted);
  CHECK(stage.unsettled() == Texts{"stands: is stuck in /Environment/table"});
}

TEST_CASE("What the last step pushed moves, whatever its velocity", "[settle]") {
  FurnishedRoom stage;
  const NodeId pushed = stage.add_object("pushed", kBox, at(0.2, 0.1, 0.8));
  BodyPoses before = body_poses(stage.scene);
  CHECK(stage.unsettled({before, 0.02}) == Texts{});
  before.at(pushed).translation().x() -= 0.002;
  CHECK(stage.unsettled({before, 0.02}) == Texts{"pushed: moves at 0.10 m/s"});
}

TEST_CASE("Two things that hold each other hang both; what floats may hang and hold", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("lower", kBox, at(0, 0, 1.5));
  stage.add_object("upper", kBox, at(0, 0, 1.7));
  stage.add_object("balloon", kBox, at(2, 0, 1.5), false);
  stage.add_object("on_balloon", kBox, at(2, 0, 1.7));
  CHECK(stage.unsettled() == Texts{"lower: hangs in the air", "upper: hangs in the air"});
}

TEST_CASE("What leans against something and stands on nothing hangs in the air", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("at_its_side", kBox, at(0.601, 0, 0.4));
  stage.add_object("stands_there_too", kBox, at(-0.601, 0, 0.1));
  stage.add_object("between", kBox, at(-0.702, -0.1, 0.5) * Eigen::AngleAxisd(0.1, Vec3::UnitY()));
  CHECK(stage.unsettled() == Texts{"at_its_side: hangs in the air", "between: hangs in the air"});
}

TEST_CASE("What touches a board that leans by 5 degrees is not held by it, by one of 30 it is",
          "[settle]") {
  const auto leaning = [](double degrees) {
    const double angle = degrees * kPi / 180.0;
    FurnishedRoom stage;
    stage.add(stage.environment, "board", make_box(Vec3(0.5, 0.02, 2.0)),
              at(2, 1, 1) * Eigen::AngleAxisd(-angle, Vec3::UnitX()));
    // Its lower edge is a tenth of a millimetre before the board.
    const double front = 1.0 - 0.01 / std::cos(angle) - 0.6 * std::tan(angle);
    stage.add_object("box", kBox, at(2, front - 0.1 - 1e-4, 0.5));
    return stage.unsettled();
  };
  CHECK(leaning(5.0) == Texts{"box: hangs in the air"});
  CHECK(leaning(30.0) == Texts{});
}

TEST_CASE("A frame hangs on a peg by its upper bar, a box stands on a corner, a fork is sunk in",
          "[settle]") {
  FurnishedRoom stage;
  stage.add(stage.environment, "peg", make_box(Vec3(0.4, 0.01, 0.01)), at(0.7, 0, 0.6));
  Mesh frame = make_box(Vec3(0.02, 0.3, 0.02));
  const Mesh lower = frame;
  for (auto position : lower.positions) frame.positions.push_back(position - Vec3f(0, 0, 0.2f));
  for (auto indices : lower.triangles) {
    for (auto& index : indices) index += std::uint32_t(lower.positions.size());
    frame.triangles.push_back(indices);
  }
  frame.normals.clear();
  frame.uvs.clear();
  stage.add_object("frame", frame, at(0.8, 0, 0.616));
  const auto on_corner = Eigen::Quaterniond::FromTwoVectors(Vec3(1, 1, 1), Vec3::UnitZ());
  stage.add_object("on_a_corner", kBox, at(-2, -2, 0.1 * std::sqrt(3.0) + 0.002) * on_corner);
  stage.add_object("fork", make_box(Vec3(0.15, 0.02, 0.002)), at(0, 0.2, 0.7));
  CHECK(stage.unsettled() == Texts{});
}

TEST_CASE("A thing of many triangles stands on a foot of few", "[settle]") {
  FurnishedRoom stage;
  const NodeId ball = stage.add_object("ball", make_sphere(0.15, 192), at(2, 1, 0.45));
  stage.add(ball, "foot", make_box(Vec3(0.002, 0.002, 0.31)), at(0.031, 0.017, -0.295));
  CHECK(stage.unsettled() == Texts{});
}

TEST_CASE("Things that lie on what is hidden hang in the air", "[settle]") {
  FurnishedRoom stage;
  stage.add_object("mug", kBox, at(0, 0, 0.8));
  CHECK(stage.unsettled() == Texts{});
  stage.scene.edit(stage.table).is_visible = false;
  CHECK(stage.unsettled() == Texts{"mug: hangs in the air"});
}

TEST_CASE("Objects that start in a table, in each other or in a hidden lamp are named",
          "[settle]") {
  FurnishedRoom stage;
  const NodeId lamp = stage.add(stage.environment, "lamp", make_sphere(0.2), at(2, 2, 2));
  stage.scene.edit(lamp).is_visible = false;
  stage.add_object("free", kBox, at(0, 0, 1.2));
  stage.add_object("in_table", kBox, at(0.55, 0, 0.5));
  stage.add_object("swallowed", make_sphere(0.05), at(0, 0, 0.3));
  stage.add_object("in_lamp", make_sphere(0.05), at(2, 2, 2));
  stage.add_object("pair_a", kBox, at(-2, 0, 1));
  stage.add_object("pair_b", kBox, at(-1.9, 0, 1.05), false);
  Texts names;
  for (const Flaw& flaw : find_born_inside(stage.scene, stage.objects)) {
    names.push_back(stage.scene[flaw.node].name + " " + flaw.why);
  }
  CHECK(names == Texts{"in_table starts in /Environment/table",
                       "swallowed starts in /Environment/table",
                       "in_lamp starts in /Environment/lamp", "pair_a starts in /Assets/pair_b",
                       "pair_b starts in /Assets/pair_a"});
}

TEST_CASE("Cameras in something or right before it are named", "[settle]") {
  FurnishedRoom stage;
  std::vector<NodeId> cameras;
  for (const Vec3& place : {Vec3(2, 2, 1.5), Vec3(0, 0, 0.4), Vec3(0.7, 0, 0.5)}) {
    cameras.push_back(stage.scene.create(stage.scene.root(), "cam"));
    stage.scene.edit(cameras.back()).camera = Camera{};
    stage.scene.edit(cameras.back()).camera->near_m = 0.25;
    stage.scene.set_pose(cameras.back(), Affine(Eigen::Translation3d(place)));
  }
  const std::vector<Flaw> flaws = find_blocked_cameras(stage.scene, cameras);
  REQUIRE(flaws.size() == 2);
  CHECK(flaws[0].node == cameras[1]);
  CHECK(flaws[0].why == "stands in /Environment/table");
  CHECK(flaws[1].node == cameras[2]);
  CHECK(flaws[1].why == "is 0.200 m from something");
}

TEST_CASE("Physics looks anew when anything that collides changed, and only then", "[settle]") {
  FurnishedRoom stage;
  stage.scene.edit(stage.table).collider = Collider{};
  const NodeId mug = stage.add_object("mug", kBox, at(0, 0, 0.8));
  const NodeId lamp = stage.scene.create(stage.scene.root(), "Lamp");
  const PhysicsView before(stage.scene);
  CHECK(before.is_of(stage.scene));
  // Lamps and colours are not its business.
  stage.scene.set_pose(lamp, at(1, 2, 3));
  stage.scene.edit(mug).labels["class"] = "cup";
  CHECK(before.is_of(stage.scene));

  SECTION("how fast something goes") {
    stage.scene.edit(mug).rigid_body->linear_velocity = Vec3(1, 0, 0);
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("how fast something turns") {
    stage.scene.edit(mug).rigid_body->angular_velocity = Vec3(0, 1, 0);
    CHECK_FALSE(before.is_of(stage.scene));
  }

  SECTION("the table moves with what it stands on") {
    stage.scene.set_pose(stage.environment, at(0, 0, 0.1));
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("its collider") {
    stage.scene.edit(stage.table).collider->shape = ColliderShape::BoundingBox;
    CHECK_FALSE(before.is_of(stage.scene));
    stage.scene.edit(stage.table).collider.reset();
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("its mesh") {
    stage.scene.edit(stage.table).mesh = std::make_shared<const Mesh>(kBox);
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("its visibility, from above") {
    stage.scene.edit(stage.environment).is_visible = false;
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("a body is gone") {
    stage.scene.erase(mug);
    CHECK_FALSE(before.is_of(stage.scene));
  }
  SECTION("moved there and back is as before") {
    stage.scene.set_pose(stage.table, at(0, 0, 5));
    stage.scene.set_pose(stage.table, at(0, 0, 0.35));
    CHECK(before.is_of(stage.scene));
  }
}
