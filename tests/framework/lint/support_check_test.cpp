// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/support_check.h"

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "support/catch.h"

using namespace diorama;

namespace {

Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

/// A room of 6 x 4 x 3 m with its floor at z = 0 and a table top of 1.2 x 0.8 x 0.04 m at 0.7 m.
struct Stage {
  Stage() {
    environment = scene.create(scene.root(), "Environment");
    Mesh walls = make_box(Vec3(6, 4, 3));
    for (auto& [a, b, c] : walls.triangles) std::swap(b, c);  // faces look inwards
    add(environment, "walls", walls, at(0, 0, 1.5));
    add(environment, "table", make_box(Vec3(1.2, 0.8, 0.04)), at(0, 0, 0.7));
    assets = scene.create(scene.root(), "Assets");
  }
  NodeId add(NodeId parent, const std::string& name, const Mesh& mesh, const Affine& pose) {
    const NodeId node = scene.create(parent, name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, pose);
    return node;
  }
  void add_object(const std::string& name, const Mesh& mesh, const Affine& pose,
                  bool falls = true) {
    objects.push_back({add(assets, name, mesh, pose), falls});
  }
  /// "name: why", in order.
  std::vector<std::string> unheld() const {
    std::vector<std::string> texts;
    for (const Flaw& flaw : find_unheld(scene, environment, objects)) {
      texts.push_back(scene[flaw.node].name + ": " + flaw.why);
    }
    return texts;
  }

  Scene scene;
  NodeId environment, assets;
  std::vector<JudgedObject> objects;
};

using Texts = std::vector<std::string>;
const Mesh kBox = make_box(Vec3(0.2, 0.12, 0.1));
constexpr double kOnTable = 0.72;

/// An open bowl without thickness, its normals outwards: half a ball.
Mesh open_bowl(double radius) {
  const Mesh ball = make_sphere(radius);
  Mesh bowl = ball;
  bowl.triangles.clear();
  for (const auto& triangle : ball.triangles) {
    bool is_low = true;
    for (const auto index : triangle) is_low = is_low && ball.positions[index].z() <= 1e-6F;
    if (is_low) bowl.triangles.push_back(triangle);
  }
  return bowl;
}

}  // namespace

TEST_CASE("What lies, leans, is stacked or floats by design is held", "[support]") {
  Stage stage;
  stage.add_object("on_table", kBox, at(0.3, 0.1, kOnTable + 0.05));
  stage.add_object("on_box", kBox, at(0.33, 0.12, kOnTable + 0.152));
  stage.add_object("on_floor", make_sphere(0.07), at(2, 1, 0.068));
  // A rod that leans against the table's edge with nothing but its ends touching.
  stage.add_object("leans", make_box(Vec3(1.2, 0.01, 0.01)),
                   Affine(Eigen::Translation3d(-0.7823, 0.2, 0.487) *
                          Eigen::AngleAxisd(-std::atan2(0.8, 0.6), Vec3::UnitY())));
  stage.add_object("floats", kBox, at(1, 1, 2), false);
  stage.add_object("on_floating", make_sphere(0.05), at(1, 1, 2.1));
  // Mirrored, and a skin of 5 mm away.
  stage.add_object("mirrored", kBox,
                   Affine(at(-0.3, -0.2, kOnTable + 0.055) * Eigen::Scaling(Vec3(-1, 1, 1))));
  stage.add_object("bowl", open_bowl(0.15), at(-2, -1, 0.15));
  stage.add_object("in_bowl", make_sphere(0.03), at(-2, -1, 0.032));
  CHECK(stage.unheld() == Texts{});
}

TEST_CASE("What is lifted by three centimetres hangs, and what lies on it as well", "[support]") {
  Stage stage;
  stage.add_object("lifted", kBox, at(0.3, 0.1, kOnTable + 0.08));
  stage.add_object("on_lifted", kBox, at(0.3, 0.1, kOnTable + 0.18));
  stage.add_object("on_table", kBox, at(-0.3, 0.1, kOnTable + 0.05));
  // 6 mm beside the one on the table.
  stage.add_object("neighbour", kBox, at(-0.3, 0.226, kOnTable + 0.08));
  // Its box is on the table, its own surface beside the edge.
  stage.add_object("beside", make_sphere(0.1), at(0.7, 0.5, 0.72));
  CHECK(stage.unheld() == Texts{"lifted: hangs in the air", "on_lifted: hangs in the air",
                                "neighbour: hangs in the air", "beside: hangs in the air"});
}

TEST_CASE("What is inside a table or another object is stuck there", "[support]") {
  Stage stage;
  stage.add_object("in_table", kBox, at(0.3, 0.1, 0.7));
  stage.add_object("spoon", make_box(Vec3(0.01, 0.005, 0.2)), at(-0.3, 0.1, 0.7));
  stage.add_object("big", make_sphere(0.3), at(2, 1, 0.298));
  stage.add_object("small", make_sphere(0.04), at(2, 1, 0.25), false);
  // 4 mm deep, as engines leave things.
  stage.add_object("dent", kBox, at(0, -0.2, kOnTable + 0.046));
  CHECK(stage.unheld() == Texts{"in_table: is stuck in /Environment/table",
                                "spoon: is stuck in /Environment/table",
                                "small: is stuck in /Assets/big"});
}

namespace {

Mesh flipped(Mesh mesh) {
  for (auto& [a, b, c] : mesh.triangles) std::swap(b, c);
  return mesh;
}

/// A box without those of its faces whose middles lie there.
template <class Lies>
Mesh box_without(const Vec3& size, Lies&& lies) {
  Mesh box = make_box(size);
  std::erase_if(box.triangles, [&](const auto& triangle) {
    Vec3f middle = Vec3f::Zero();
    for (const auto corner : triangle) middle += box.positions[corner] / 3.0F;
    return lies(middle);
  });
  return box;
}

Mesh sheet(double x, double y) {
  Mesh flat;
  for (const auto& [u, v] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
    flat.positions.push_back(Vec3f(float(u * x), float(v * y), 0.0F));
  }
  flat.triangles = {{0, 1, 2}, {0, 2, 3}};
  return flat;
}

Affine upright(double x, double y, double z) {
  return at(x, y, z) * Eigen::AngleAxisd(kPi / 2, Vec3::UnitY());
}

/// Furniture as others model it.
struct FurnishedStage : Stage {
  FurnishedStage() {
    const auto is_low = [](const Vec3f& middle) { return middle.z() < -0.19F; };
    const auto is_front = [](const Vec3f& middle) { return middle.x() > 0.24F; };
    const auto is_end = [](const Vec3f& middle) { return std::abs(middle.z()) > 0.19F; };
    add(environment, "sofa", box_without(Vec3(1.6, 0.9, 0.4), is_low), at(1.8, -1.4, 0.2));
    add(environment, "chest", flipped(make_box(Vec3(0.8, 0.6, 0.5))), at(-2.2, 1.4, 0.25));
    add(environment, "shelf", box_without(Vec3(0.5, 0.9, 0.5), is_front), at(-2.6, -1.2, 1.2));
    add(environment, "screen", make_box(Vec3(0.008, 1.0, 1.2)), at(1, 1.2, 0.6));
    add(environment, "shade", box_without(Vec3(0.4, 0.4, 0.4), is_end), at(0, 0, 2));
    add(environment, "globe", make_sphere(0.15), at(-1, 0, 2.2));
    add(environment, "cloth", sheet(0.5, 0.5), at(2, 1.2, 0.9));
    // Nothing hangs in these, as far as they stand.
    add_object("box", kBox, at(0.3, 0.1, kOnTable + 0.05));
    add_object("drifts", kBox, at(1.8, 0.4, 1.5), false);
  }
};

}  // namespace

TEST_CASE("Each of ten seeded things in mid-air is named", "[support]") {
  const Mesh paper = sheet(0.2, 0.3);
  const Mesh ball = make_sphere(0.05);
  const std::vector<std::pair<Mesh, Affine>> seeded{
      {kBox, at(-0.3, 0.1, kOnTable + 0.08)},   // 3 cm over the table
      {kBox, at(0.3, 0.222, kOnTable + 0.15)},  // beside a box, 2 mm away
      {kBox, at(2.898, 1, 1)},                  // at the wall
      {ball, at(2.95, -0.5, 1.2)},              // touches the wall
      {kBox, at(0.2, 0.1, 0.628)},              // under the table, 2 mm away
      {kBox, at(1.8, 0.521, 1.5)},              // beside one that drifts
      {ball, at(-2.6, -1.2, 0.899)},            // under the shelf
      {kBox, at(1.106, 1.2, 0.7)},              // at a screen, 2 mm away
      {paper, upright(2.998, -1, 1)},           // a sheet along the wall
      {paper, at(-1, 1, 0.03)},                 // a sheet over the floor
  };
  for (std::size_t i = 0; i < seeded.size(); ++i) {
    FurnishedStage stage;
    stage.add_object("seeded", seeded[i].first, seeded[i].second);
    INFO("number " << i + 1);
    CHECK(stage.unheld() == Texts{"seeded: hangs in the air"});
  }
}

TEST_CASE("Each of nine seeded things inside of others is named", "[support]") {
  struct Seed {
    Mesh mesh;
    Affine pose;
    std::string in;
  };
  const std::vector<Seed> seeded{
      {kBox, at(-0.3, 0.1, 0.7), "Environment/table"},
      {make_box(Vec3(0.01, 0.005, 0.2)), at(-0.3, 0.1, 0.7), "Environment/table"},
      {kBox, at(1.8, -1.4, 0.05), "Environment/sofa"},  // on the floor, below an open one
      {kBox, at(1.8, -1.4, 0.4), "Environment/sofa"},   // half sunk into its top
      {kBox, at(-2.2, 1.4, 0.2), "Environment/chest"},  // faces look inwards
      {kBox, at(1, 1.2, 0.05), "Environment/screen"},   // thinner than any depth
      {kBox, at(2, 1.2, 0.91), "Environment/cloth"},    // no thickness at all
      {make_sphere(0.04), at(-1, 0.02, 2.2), "Environment/globe"},
      {kBox, at(0.38, 0.12, kOnTable + 0.06), "Assets/box"},
  };
  for (std::size_t i = 0; i < seeded.size(); ++i) {
    FurnishedStage stage;
    stage.add_object("seeded", seeded[i].mesh, seeded[i].pose);
    INFO("number " << i + 1);
    CHECK_THAT(stage.unheld(),
               Catch::Matchers::VectorContains("seeded: is stuck in /" + seeded[i].in));
  }
}

TEST_CASE("Each of nine seeded cameras in things is named, and free ones are not", "[support]") {
  FurnishedStage stage;
  stage.add_object("vase", make_sphere(0.2), at(-0.3, 0, kOnTable + 0.2));
  const std::vector<std::pair<Vec3, std::string>> seeded{
      {Vec3(-1, 0, 2.2), "stands in /Environment/globe"},
      {Vec3(0.02, -0.03, 2.02), "stands in /Environment/shade"},
      {Vec3(1.8, -1.4, 0.2), "stands in /Environment/sofa"},
      {Vec3(-2.2, 1.4, 0.25), "stands in /Environment/chest"},
      {Vec3(-2.62, -1.2, 1.2), "stands in /Environment/shelf"},
      {Vec3(-0.3, 0, kOnTable + 0.2), "stands in /Assets/vase"},
      {Vec3(2.96, 0.5, 1), "is 0.040 m from /Environment/walls"},
      {Vec3(2, 1.2, 0.95), "is 0.050 m from /Environment/cloth"},
      {Vec3(1.014, 1, 1), "is 0.010 m from /Environment/screen"},
  };
  std::vector<JudgedCamera> cameras;
  for (const auto& seed : seeded) cameras.push_back({seed.first, 0.1});
  const auto reasons = find_blocked(stage.scene, stage.environment, cameras);
  for (std::size_t i = 0; i < seeded.size(); ++i) CHECK(reasons[i] == seeded[i].second);
  // Under the table, in a corner, over the vase, before the shelf, between sofa and screen.
  const std::vector<JudgedCamera> free{{Vec3(0.1, 0.1, 0.4), 0.1},
                                       {Vec3(2.8, 1.8, 0.2), 0.1},
                                       {Vec3(-0.3, 0, kOnTable + 0.55), 0.1},
                                       {Vec3(-2.2, -1.2, 1.2), 0.1},
                                       {Vec3(1.3, 0.3, 0.4), 0.1}};
  CHECK(find_blocked(stage.scene, stage.environment, free) == Texts(free.size(), ""));
}
