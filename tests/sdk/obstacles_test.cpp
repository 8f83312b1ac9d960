// SPDX-License-Identifier: Apache-2.0
#include "diorama/obstacles.h"

#include "diorama/rng.h"
#include "support/catch.h"

using namespace diorama;

namespace {

struct Stage {
  NodeId add(const std::string& name, const Mesh& mesh, const Affine& pose) {
    const NodeId node = scene.create(scene.root(), name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, pose);
    return node;
  }
  Obstacles all() const { return Obstacles(scene, scene[scene.root()].children, kCount); }

  static constexpr auto kCount = Obstacles::Hidden::Count;
  Scene scene;
};

Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

/// Turned, and scaled differently along each axis.
Affine stretched() {
  Transform pose;
  pose.translation = Vec3(1, -2, 3);
  pose.rotation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  pose.scale = Vec3(0.5, 3.0, 0.01);
  return pose.affine();
}

}  // namespace

TEST_CASE("Distances to a ball of triangles are those to the ball", "[obstacles]") {
  Stage stage;
  stage.add("ball", make_sphere(0.5, 256), at(2, 0, 0));
  const Obstacles all = stage.all();
  CHECK(all.distance(Vec3(0, 0, 0), 10.0) == Approx(1.5).margin(1e-4));
  CHECK(all.distance(Vec3(2, 3, 4), 10.0) == Approx(4.5).margin(1e-3));
  CHECK(all.distance(Vec3(2, 0, 0), 10.0) == Approx(0.5).margin(1e-3));
  CHECK(all.distance(Vec3(0, 0, 0), 0.3) == 0.3);
  CHECK(all.is_near(Vec3(0, 0, 0), 1.51));
  CHECK_FALSE(all.is_near(Vec3(0, 0, 0), 1.49));
}

TEST_CASE("Answers about a stretched mesh are those of every triangle, one by one", "[obstacles]") {
  Stage stage;
  const Mesh mesh = make_sphere(0.6, 24);
  const NodeId node = stage.add("egg", mesh, stretched());
  const Obstacles all = stage.all();
  Rng rng(3);
  const Affine world = stage.scene.world_from_node(node);
  for (int i = 0; i < 40; ++i) {
    const Vec3 point = rng.uniform_in({Vec3(-1, -4, 1), Vec3(3, 0, 5)});
    double nearest = kInfinity;  // of many points of every triangle: never below the true distance
    for (const auto& [a, b, c] : mesh.triangles) {
      for (int u = 0; u <= 8; ++u) {
        for (int v = 0; u + v <= 8; ++v) {
          const Vec3f p = mesh.positions[a] +
                          (float(u) / 8) * (mesh.positions[b] - mesh.positions[a]) +
                          (float(v) / 8) * (mesh.positions[c] - mesh.positions[a]);
          nearest = std::min(nearest, (world * p.cast<double>() - point).norm());
        }
      }
    }
    const double found = all.distance(point, 100.0);
    CHECK(found <= nearest + 1e-9);
    CHECK(found > nearest - 0.03);
  }
}

TEST_CASE("The first hit says where, whose and from which side", "[obstacles]") {
  Stage stage;
  const NodeId near = stage.add("near", make_box(Vec3(1, 1, 1)), at(2, 0.1, 0.2));
  const NodeId far = stage.add("far", make_box(Vec3(1, 1, 1)), at(5, 0.1, 0.2));
  const Obstacles all = stage.all();
  const auto hit = all.first_hit(Vec3::Zero(), Vec3(10, 0, 0));
  REQUIRE(hit);
  CHECK(hit->t == Approx(0.15));
  CHECK(hit->owner == near);
  CHECK_FALSE(hit->is_leaving);
  CHECK(all.first_hit(Vec3(2, 0, 0), Vec3(10, 0, 0))->is_leaving);
  CHECK(all.first_hit(Vec3::Zero(), Vec3(10, 0, 0), near)->owner == far);
  CHECK_FALSE(all.first_hit(Vec3::Zero(), Vec3(1.4, 0, 0)));
  CHECK(all.is_between(Vec3::Zero(), Vec3(1.6, 0, 0)));
  CHECK_FALSE(all.is_between(Vec3::Zero(), Vec3(1.6, 0, 0), near));
}

TEST_CASE("A box is met where a triangle reaches into it, whatever turns it", "[obstacles]") {
  Stage stage;
  stage.add("floor", make_plane(10, 10), at(0, 0, 0));
  const Obstacles all = stage.all();
  const Aabb box{Vec3(-0.1, -0.1, -0.1), Vec3(0.1, 0.1, 0.1)};
  CHECK_FALSE(all.meets_box(box, at(0.3, 0.4, 0.101)));
  CHECK(all.meets_box(box, at(0.3, 0.4, 0.099)));
  CHECK_FALSE(all.meets_box(box, at(5.2, 0.4, 0.0)));
  // On its edge it reaches sqrt(2) times as far down.
  const Affine on_edge = at(0, 0, 0.14) * Eigen::AngleAxisd(kPi / 4, Vec3::UnitX());
  CHECK(all.meets_box(box, on_edge));
  CHECK_FALSE(all.meets_box(box, at(0, 0, 0.002) * on_edge));
}

TEST_CASE("Things are near each other by their triangles, not by their boxes", "[obstacles]") {
  Stage stage;
  const NodeId floor = stage.add("floor", make_box(Vec3(10, 10, 1)), at(0, 0, -0.5));
  // A tip that points down, 2 cm above the floor; a needle stands in the cone's shade.
  const Affine upside_down = at(0, 0, 0.52) * Eigen::AngleAxisd(kPi, Vec3::UnitX());
  const NodeId cone = stage.add("cone", make_cone(0.5, 1.0), upside_down);
  const NodeId needle = stage.add("needle", make_box(Vec3(0.01, 0.01, 0.3)), at(0.4, 0, 0.15));
  const Obstacles all = stage.all();
  CHECK(all.near_node(stage.scene, cone, 0.019) == std::vector<NodeId>{});
  CHECK(all.near_node(stage.scene, cone, 0.021) == std::vector<NodeId>{floor});
  CHECK(all.near_node(stage.scene, cone, 0.021, floor) == std::vector<NodeId>{});
  CHECK(all.near_node(stage.scene, needle, 0.05) == std::vector<NodeId>{floor});
  stage.scene.set_pose(needle, at(0.2, 0, 0.5));
  CHECK(stage.all().near_node(stage.scene, needle, 0.0) == std::vector<NodeId>{cone});
}

TEST_CASE("How near stretched things are is how near points of their triangles are",
          "[obstacles]") {
  const Mesh egg = make_sphere(0.6, 20);
  const Mesh box = make_box(Vec3(0.5, 0.7, 0.3));
  Rng rng(11);
  int apart = 0;
  for (int i = 0; i < 60; ++i) {
    Stage stage;
    stage.add("egg", egg, stretched());
    const Vec3 place = rng.uniform_in({Vec3(0, -4, 1.5), Vec3(2, 0, 4.5)});
    Affine pose(Eigen::Translation3d(place.x(), place.y(), place.z()));
    pose.rotate(Eigen::AngleAxisd(0.1 * i, Vec3(3, -1, 2).normalized()));
    pose.scale(Vec3(1.0, 0.4, 2.0));
    const NodeId brick = stage.add("brick", box, pose);
    const Obstacles all = stage.all();
    double nearest = kInfinity;  // of points all over the brick: never below the true distance
    constexpr int kSteps = 40;
    for (const auto& [a, b, c] : box.triangles) {
      for (int u = 0; u <= kSteps; ++u) {
        for (int v = 0; u + v <= kSteps; ++v) {
          const Vec3f p = box.positions[a] +
                          (float(u) / kSteps) * (box.positions[b] - box.positions[a]) +
                          (float(v) / kSteps) * (box.positions[c] - box.positions[a]);
          nearest = std::min(nearest, all.distance(pose * p.cast<double>(), 100.0, brick));
        }
      }
    }
    const auto are_near = [&](double distance) {
      return !all.near_node(stage.scene, brick, distance).empty();
    };
    CAPTURE(i, nearest);
    CHECK(are_near(nearest + 1e-6));
    // Half of the way between two of the points.
    constexpr double kSpacing = 0.02;
    if (nearest < kSpacing) continue;
    ++apart;
    CHECK_FALSE(are_near(nearest - kSpacing));
  }
  CHECK(apart > 20);
  CHECK(apart < 60);
}

TEST_CASE("Closed meshes enclose, cups and rooms do not", "[obstacles]") {
  Stage stage;
  stage.add("room", make_box(Vec3(6, 5, 3)), at(0, 0, 1.5));
  const NodeId crate = stage.add("crate", make_box(Vec3(1, 1, 1)), at(1, 1, 0.5));
  Mesh cup = make_box(Vec3(1, 1, 1));
  std::erase_if(cup.triangles, [&](const auto& triangle) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](std::uint32_t corner) { return cup.positions[corner].z() > 0.0f; });
  });
  stage.add("cup", cup, at(-1, -1, 0.5));
  const Obstacles all = stage.all();
  CHECK(all.encloser(Vec3(1, 1, 0.5)) == crate);
  CHECK(all.encloser(Vec3(0.51, 1.2, 0.5)) == crate);
  CHECK_FALSE(all.encloser(Vec3(1, 1, 0.5), crate));
  CHECK_FALSE(all.encloser(Vec3(0.49, 1.2, 0.5)));
  CHECK_FALSE(all.encloser(Vec3(-1, -1, 0.5)));
  CHECK_FALSE(all.encloser(Vec3(0, 0, 1.5)));
}

TEST_CASE("Hidden meshes count where they are asked for, empty ones never", "[obstacles]") {
  Stage stage;
  const NodeId wall = stage.add("wall", make_box(Vec3(1, 1, 1)), at(2, 0.1, 0.1));
  stage.add("nothing", Mesh{}, at(0, 0, 0));
  stage.scene.edit(wall).is_visible = false;
  CHECK(stage.all().is_between(Vec3::Zero(), Vec3(4, 0, 0)));
  CHECK_FALSE(Obstacles(stage.scene, "/**").is_between(Vec3::Zero(), Vec3(4, 0, 0)));
  CHECK_FALSE(Obstacles(stage.scene, "/none").is_between(Vec3::Zero(), Vec3(4, 0, 0)));
}

TEST_CASE("Bodies at the origin wait to be placed", "[obstacles]") {
  Stage stage;
  const NodeId waits = stage.add("waits", make_box(Vec3(1, 1, 1)), Affine::Identity());
  const NodeId placed = stage.add("placed", make_box(Vec3(1, 1, 1)), at(0, 0, 1));
  stage.add("furniture", make_box(Vec3(1, 1, 1)), Affine::Identity());
  for (const NodeId node : {waits, placed}) stage.scene.edit(node).rigid_body = RigidBody{};
  CHECK(unplaced_bodies(stage.scene) == std::vector<NodeId>{waits});
}
