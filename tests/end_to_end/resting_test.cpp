// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/rng.h"
#include "framework/pipeline/scene_setup.h"
#include "loader_dining_room/dining_room.h"
#include "physics_bullet/bullet_backend.h"
#include "support/catch.h"
#include "support/exact_bounds.h"
#include "support/plain_host.h"
#include "support/sample_meshes.h"

/// The rooms and objects of the sample pack with the physics of the default job, many objects each.
using namespace diorama;

namespace {

using Meshes = std::vector<std::shared_ptr<const Mesh>>;

struct Room {
  Room(std::uint64_t seed, test::PlainHost& host) {
    environment = scene.create(scene.root(), "Environment");
    dining_room::build_dining_room(seed, host, scene, environment);
    EnvironmentRules rules;
    rules.hide = {"001_SPLIT_GLA"};
    rules.box_colliders = {"TableDining"};
    rules.working_area = "TableDining";
    working_area = apply_environment_rules(rules, false, environment, scene, host);
  }

  void drop(const Meshes& meshes, int count, Rng rng) {
    const Aabb above{Vec3(-0.9, -0.9, 1.0), Vec3(0.9, 0.9, 1.6)};
    for (int i = 0; i < count; ++i) {
      const NodeId id = scene.create(scene.root(), "thing_" + std::to_string(i));
      scene.edit(id).mesh = meshes[rng.index(meshes.size())];
      scene.edit(id).collider = Collider{};
      scene.edit(id).collider->shape = ColliderShape::ConvexHull;
      scene.edit(id).rigid_body = RigidBody{};
      Transform pose;
      pose.translation = working_area + rng.uniform_in(above);
      pose.rotation = rng.uniform_rotation();
      pose.scale = Vec3::Constant(rng.uniform(0.3, 1.15));
      scene.set_pose(id, pose.affine());
      things.push_back(id);
    }
  }

  Scene scene;
  NodeId environment;
  Vec3 working_area = Vec3::Zero();
  std::vector<NodeId> things;
};

/// Forty things in a sample room.
void expect_rest(std::uint64_t first_seed, std::uint64_t last_seed) {
  test::PlainHost host;
  // Not held to this yet: parts of these (a white board's panel, the pages of a book, a barrel) end
  // up to 30 mm deep in furniture.
  constexpr std::array<std::string_view, 9> kLeftOut{
      "SM_BarelPlastic_B_03", "SM_Board",       "SM_Book_03",
      "SM_Book_34",           "SM_BookOpen_01", "SM_Briefcase",
      "SM_Extinguisher",      "SM_GasCart_01b", "SM_Toweldispenser_01a"};
  const Meshes meshes = test::sample_meshes(host, kLeftOut);
  for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
    Room room(seed, host);
    room.drop(meshes, 40, Rng(seed));
    BulletBackend physics({}, host);
    physics.reset(room.scene);
    physics.advance(room.scene, 264);
    const PhysicsReport report = physics.report();
    CAPTURE(seed, report.max_speed, report.max_penetration_m, report.deepest_body);
    CHECK(report.moving_bodies == 40);
    // Of 30 rooms two have one deeper than 15 mm: a chair's leg and a wine glass go through it.
    CHECK(report.max_penetration_m < 0.025);
    int slow = 0;
    for (const NodeId thing : room.things) {
      const Aabb box = test::exact_bounds(room.scene, thing);
      const Vec3 middle = box.centre();
      INFO(room.scene.path(thing) << " at " << middle.transpose());
      CHECK(box.min.z() > -0.01);  // the floor is at 0
      const double speed = room.scene[thing].rigid_body->linear_velocity.norm();
      slow += speed < 0.1 ? 1 : 0;
    }
    CHECK(slow >= 36);  // one may just be rolling off a chair
  }
}

}  // namespace

TEST_CASE("In sample rooms forty things come to rest, none through the floor or deep in furniture",
          "[run][slow]") {
  expect_rest(1, 3);
}

// By night: three rooms tell of most mistakes.
TEST_CASE("So they do in the other seven", "[.large]") { expect_rest(4, 10); }
