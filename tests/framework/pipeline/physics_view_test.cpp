// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/physics_view.h"

#include "support/catch.h"

using namespace diorama;

namespace {

NodeId add(Scene& scene, NodeId parent, const char* name, bool moves = false) {
  const NodeId node = scene.create(parent, name);
  scene.edit(node).collider = Collider{};
  if (moves) scene.edit(node).rigid_body = RigidBody{};
  return node;
}

}  // namespace

TEST_CASE("Physics does not see what a job hides, and sees what came hidden", "[physics]") {
  Scene scene;
  const NodeId table = add(scene, scene.root(), "table");
  const NodeId top = add(scene, table, "top");
  const NodeId proxy = add(scene, scene.root(), "proxy");
  const NodeId lamp = add(scene, scene.root(), "lamp");
  const NodeId mug = add(scene, scene.root(), "mug", true);
  scene.edit(proxy).is_visible = false;
  scene.edit(lamp).is_visible = false;
  HiddenNodes hidden;
  hidden.note_new(scene);
  hidden.hidden_by_job({lamp});
  const auto seen = [&] {
    const HiddenNodes::Aside aside(scene, hidden);
    std::vector<NodeId> nodes;
    for (const NodeId node : scene.subtree(scene.root())) {
      if (scene[node].collider) nodes.push_back(node);
    }
    return nodes;
  };
  using Nodes = std::vector<NodeId>;
  CHECK(seen() == Nodes{table, top, proxy, mug});
  scene.edit(table).is_visible = false;
  CHECK(seen() == Nodes{proxy, mug});
  CHECK(scene[top].collider);  // all of it is there again
  scene.edit(table).is_visible = true;
  scene.edit(lamp).is_visible = true;
  CHECK(seen() == Nodes{table, top, proxy, lamp, mug});
  // What comes hidden later on stands in for something as well.
  const NodeId ramp = add(scene, scene.root(), "ramp");
  scene.edit(ramp).is_visible = false;
  hidden.note_new(scene);
  CHECK(seen() == Nodes{table, top, proxy, lamp, mug, ramp});
}

TEST_CASE("Bodies that a job hides stand still and come back at rest", "[physics]") {
  Scene scene;
  const NodeId mug = add(scene, scene.root(), "mug", true);
  HiddenNodes hidden;
  hidden.note_new(scene);
  scene.edit(mug).rigid_body->mass_kg = 0.3;
  scene.set_velocity(mug, Vec3(1, 2, 3), Vec3(4, 5, 6));
  scene.edit(mug).is_visible = false;
  {
    const HiddenNodes::Aside aside(scene, hidden);
    CHECK_FALSE(scene[mug].rigid_body);
    CHECK_FALSE(scene[mug].collider);
  }
  REQUIRE(scene[mug].rigid_body);
  CHECK(scene[mug].rigid_body->mass_kg == 0.3);
  CHECK(scene[mug].rigid_body->linear_velocity == Vec3::Zero());
  CHECK(scene[mug].rigid_body->angular_velocity == Vec3::Zero());
}

TEST_CASE("Nothing of a scene changes where nothing is hidden", "[physics]") {
  Scene scene;
  add(scene, scene.root(), "mug", true);
  HiddenNodes hidden;
  hidden.note_new(scene);
  const std::uint64_t shapes = scene.shape_revision();
  { const HiddenNodes::Aside aside(scene, hidden); }
  CHECK(scene.shape_revision() == shapes);
}
