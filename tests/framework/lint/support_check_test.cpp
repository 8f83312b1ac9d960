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
