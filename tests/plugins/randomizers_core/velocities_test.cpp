// SPDX-License-Identifier: Apache-2.0
#include "diorama/error.h"
#include "framework/pipeline/fake_host.h"
#include "pull_together.h"
#include "random_velocities.h"
#include "scatter_lights.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// Bodies at heights 0, 1 and 2 above the working area, and a lamp that is none.
struct BodyShelf {
  BodyShelf() {
    const NodeId parent = scene.create(scene.root(), "Assets");
    for (int i = 0; i < 3; ++i) {
      const NodeId cup = scene.create(parent, "cup_" + std::to_string(i));
      scene.edit(cup).mesh = std::make_shared<const Mesh>(make_box(Vec3(0.2, 0.4, 0.6)));
      scene.edit(cup).rigid_body.emplace().linear_velocity = kBefore;
      scene.edit(cup).rigid_body->angular_velocity = kBefore;
      scene.set_pose(cup, Transform{context.working_area_world + Vec3(0.5 * i, -i, i)});
      cups.push_back(cup);
    }
    scene.create(parent, "lamp");
    context.moment = "shake";
  }
  const RigidBody& body(int i) const { return *scene[cups[std::size_t(i)]].rigid_body; }

  static inline const Vec3 kBefore{0.1, 0.2, 0.3};
  FakeHost host;
  Scene scene;
  std::vector<NodeId> cups;
  RandomizeContext context = [] {
    RandomizeContext made;
    made.working_area_world = Vec3(10, 20, 30);
    return made;
  }();
};

}  // namespace

TEST_CASE("Velocities are drawn per body, and null keeps what it has", "[randomizers]") {
  BodyShelf shelf;
  RandomVelocities::Params params;
  params.velocity = Distribution::between({1, -2, 4}, {2, -1, 8});
  RandomVelocities thrower(params, shelf.host);
  thrower.randomize(shelf.scene, shelf.context, Rng(3));
  for (int i = 0; i < 3; ++i) {
    const Vec3& v = shelf.body(i).linear_velocity;
    CHECK((v.x() >= 1 && v.x() <= 2 && v.y() >= -2 && v.y() <= -1 && v.z() >= 4 && v.z() <= 8));
    CHECK(shelf.body(i).angular_velocity == BodyShelf::kBefore);
  }
  CHECK(shelf.body(0).linear_velocity != shelf.body(1).linear_velocity);

  params.velocity.reset();
  params.angular_velocity_deg = Distribution::between({90, 90, 0}, {90, 90, 0});
  RandomVelocities spinner(params, shelf.host);
  const Vec3 before = shelf.body(2).linear_velocity;
  spinner.randomize(shelf.scene, shelf.context, Rng(3));
  CHECK(shelf.body(2).linear_velocity == before);
  CHECK(shelf.body(2).angular_velocity.isApprox(Vec3(kPi / 2, kPi / 2, 0), 1e-12));
}

TEST_CASE("Only what meets the box is thrown, wherever the working area is", "[randomizers]") {
  BodyShelf shelf;
  RandomVelocities::Params params;
  params.velocity = Distribution::between({0, 0, 5}, {0, 0, 5});
  // The boxes of the cups reach 0.3 m up and down: the first reaches up into it, the second down.
  params.box_min = {-3, -3, 0.29};
  params.box_max = {3, 3, 0.71};
  RandomVelocities(params, shelf.host).randomize(shelf.scene, shelf.context, Rng(3));
  CHECK(shelf.body(0).linear_velocity == Vec3(0, 0, 5));
  CHECK(shelf.body(1).linear_velocity == Vec3(0, 0, 5));
  CHECK(shelf.body(2).linear_velocity == BodyShelf::kBefore);

  params.box_max = {3, 3};
  CHECK_THROWS_WITH(RandomVelocities(params, shelf.host),
                    ContainsSubstring("box_min, box_max: expected [x, y, z] each"));
  params.box_max = {3, -4, 1};
  CHECK_THROWS_AS(RandomVelocities(params, shelf.host), Error);
}

TEST_CASE("Bodies are sent towards the working area, the farther the faster", "[randomizers]") {
  BodyShelf shelf;
  PullTogether::Params params;
  params.strength = Range{0.5, 0.5};
  PullTogether(params, shelf.host).randomize(shelf.scene, shelf.context, Rng(3));
  CHECK(shelf.body(0).linear_velocity.isZero(1e-12));
  CHECK(shelf.body(1).linear_velocity.isApprox(Vec3(-0.25, 0.5, -0.5), 1e-12));
  CHECK(shelf.body(2).linear_velocity.isApprox(Vec3(-0.5, 1, -1), 1e-12));
  CHECK(shelf.body(2).angular_velocity == BodyShelf::kBefore);
}

TEST_CASE("A lamp's temperature tints its colour and keeps its luminance", "[randomizers]") {
  BodyShelf shelf;
  const NodeId lamp = shelf.scene.require("/Assets/lamp");
  shelf.scene.edit(lamp).light.emplace();
  const auto color_at = [&](double kelvin) {
    ScatterLights::Params params;
    params.nodes = "/Assets/lamp";
    params.color = Distribution::between(Vec3::Ones(), Vec3::Ones());
    params.intensity = Range{100, 100};
    params.clearance_m = 0;
    params.temperature_k = Range{kelvin, kelvin};
    ScatterLights(params, shelf.host).randomize(shelf.scene, shelf.context, Rng(3));
    return Vec3(shelf.scene[lamp].light->color.cast<double>());
  };
  const Vec3 luminance(0.2126, 0.7152, 0.0722);
  CHECK(color_at(6500).isApprox(Vec3::Constant(100), 1e-5));
  // Ratios of a 3000 K black body to one of 6500 K, by Planck's law at 610, 545 and 465 nm.
  const Vec3 warm = color_at(3000);
  CHECK(warm.dot(luminance) == Approx(100).epsilon(1e-5));
  CHECK(warm.x() / warm.y() > 1.3);
  CHECK(warm.z() / warm.y() < 0.6);
  const Vec3 cold = color_at(9000);
  CHECK(cold.x() < cold.y());
  CHECK(cold.y() < cold.z());
}
