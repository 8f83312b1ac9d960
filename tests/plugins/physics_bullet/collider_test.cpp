// SPDX-License-Identifier: Apache-2.0
#include "diorama/error.h"
#include "physics_world.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// Height of the node's origin after it came to rest on the floor.
double resting_height(PhysicsWorld& world, NodeId node) {
  world.add_floor();
  world.run(240);
  return world.position(node).z();
}

std::string error_of(PhysicsWorld& world) {
  try {
    world.backend.reset(world.scene);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

Affine scaled(double x, double y, double z) { return Affine(Eigen::Scaling(x, y, z)); }

}  // namespace

TEST_CASE("every collider follows an uneven scale of its node", "[physics]") {
  // A mesh of 2 x 2 x 2 m, not centred on its node, stretched to 10 x 20 x 6 cm.
  Mesh mesh = make_box(Vec3(2, 2, 2));
  for (Vec3f& position : mesh.positions) position.z() += 3.0f;
  const Affine scale = scaled(0.05, 0.1, 0.03);
  for (const ColliderShape shape :
       {ColliderShape::ConvexHull, ColliderShape::BoundingBox, ColliderShape::TriangleMesh}) {
    PhysicsWorld world;
    const NodeId node = world.add("box", shared(mesh), shape, at(0, 0, 0.2) * scale);
    world.make_body(node);
    // The mesh's underside is 2 units above the node's origin.
    CHECK(resting_height(world, node) == Approx(-0.06).margin(0.002));
    CHECK(world.scene.world_bounds(node).min.z() == Approx(0.0).margin(0.002));
    CHECK(world.scene.world_bounds(node).size().y() == Approx(0.2).epsilon(1e-3));
  }
}

TEST_CASE("scale of an ancestor and a mirrored node count", "[physics]") {
  PhysicsWorld world;
  const NodeId parent = world.scene.create(world.scene.root(), "parent");
  world.scene.set_pose(parent, at(1, 2, 0) * scaled(0.1, 0.1, -0.1));
  const NodeId node = world.scene.create(parent, "cone");
  world.scene.edit(node).mesh = shared(make_cone(1.0, 2.0));
  world.scene.edit(node).collider = Collider{};
  world.scene.set_pose(node, at(0, 0, -3));
  world.make_body(node);
  // Upside down: it balances on its tip no longer than an instant and comes to lie on its side.
  world.add_floor();
  world.run(300);
  CHECK(world.scene.world_bounds(node).min.z() == Approx(0.0).margin(0.003));
  CHECK(world.scene.world_bounds(node).size().z() < 0.22);
  CHECK(world.scene[node].parent == parent);
}

TEST_CASE("primitives rest at the height of their surface", "[physics]") {
  const Vec3 size(0.1, 0.1, 0.16);
  for (const PrimitiveShape shape :
       {PrimitiveShape::Box, PrimitiveShape::Cylinder, PrimitiveShape::Cone}) {
    PhysicsWorld world;
    const NodeId node = world.add_primitive("solid", shape, size, at(0, 0, 0.1));
    world.make_body(node);
    CHECK(resting_height(world, node) == Approx(0.08).margin(5e-4));
  }
  PhysicsWorld sphere_world;
  const NodeId sphere = sphere_world.add_primitive(
      "sphere", PrimitiveShape::Sphere, Vec3::Constant(2.0), at(0, 0, 0.1) * scaled(.04, .04, .04));
  sphere_world.make_body(sphere);
  CHECK(resting_height(sphere_world, sphere) == Approx(0.04).margin(5e-4));
  PhysicsWorld capsule_world;
  const Affine lying = at(0, 0, 0.1) * Eigen::AngleAxisd(kPi / 2, Vec3::UnitX());
  const NodeId capsule =
      capsule_world.add_primitive("capsule", PrimitiveShape::Capsule, Vec3(0.06, 0.06, 0.2), lying);
  capsule_world.make_body(capsule);
  CHECK(resting_height(capsule_world, capsule) == Approx(0.03).margin(5e-4));
}

TEST_CASE("an unevenly scaled sphere collides as the ellipsoid that is seen", "[physics]") {
  PhysicsWorld world;
  const NodeId node = world.add_primitive("egg", PrimitiveShape::Sphere, Vec3::Constant(2.0),
                                          at(0, 0, 0.1) * scaled(0.1, 0.06, 0.03));
  world.make_body(node);
  CHECK(resting_height(world, node) == Approx(0.03).margin(0.002));
}

TEST_CASE("a bounding sphere rolls where its box would stand", "[physics]") {
  PhysicsWorld world;
  const NodeId node = world.add("die", shared(make_box(Vec3(0.1, 0.1, 0.1))),
                                ColliderShape::BoundingSphere, at(0, 0, 0.2));
  world.make_body(node);
  CHECK(resting_height(world, node) == Approx(0.05 * std::sqrt(3.0)).margin(1e-3));
}

TEST_CASE("colliders below one rigid body move as one about their common centre", "[physics]") {
  BulletBackend::Params params;
  params.gravity = Vec3::Zero();
  params.angular_damping = 0.0;
  PhysicsWorld world(params);
  const NodeId dumbbell = world.scene.create(world.scene.root(), "dumbbell");
  world.make_body(dumbbell, 2.0);
  world.scene.set_pose(dumbbell, at(5, 0, 0));
  const auto add_end = [&](double x) {
    const NodeId end = world.scene.create(dumbbell, "end");
    world.scene.edit(end).collider =
        Collider{ColliderShape::Primitive, PrimitiveShape::Sphere, Vec3::Constant(0.2), 0.0, 1.0};
    world.scene.set_pose(end, at(x, 0, 0));
    return end;
  };
  const NodeId left = add_end(0.0);
  const NodeId right = add_end(1.0);
  // A free ball, as heavy, hits the right end from above.
  const NodeId ball =
      world.add_primitive("ball", PrimitiveShape::Sphere, Vec3::Constant(0.2), at(6, 0, 1));
  world.make_body(ball, 2.0);
  world.scene.edit(ball).collider->restitution = 1.0;
  world.scene.edit(ball).collider->friction = 0.0;
  const NodeId pusher =
      world.add_primitive("pusher", PrimitiveShape::Box, Vec3::Constant(0.2), at(6, 0, 1.19));
  world.make_body(pusher, 50.0);
  const Vec3 arm = world.position(right) - world.position(left);
  world.run(120);
  CHECK((world.position(right) - world.position(left)).norm() == Approx(arm.norm()));
  // Rigid: the centre of both ends is the centre of mass 5.5, not the node's origin 5.
  const Affine moved = world.scene.world_from_node(dumbbell);
  CHECK((moved.linear().transpose() * moved.linear() - Mat3::Identity()).norm() < 1e-9);
}

TEST_CASE("an off-centre hit turns a compound as the closed form says", "[physics]") {
  // Momentum and energy decide a frictionless elastic hit on the end of a free body at rest.
  BulletBackend::Params params;
  params.angular_damping = 0.0;
  params.rolling_friction = 0.0;
  params.sub_steps = 8;
  PhysicsWorld world(params);
  const NodeId body = world.scene.create(world.scene.root(), "bar");
  RigidBody floats;
  floats.mass_kg = 2.0;
  floats.has_gravity = false;
  const double kArm = 0.5, kRadius = 0.1;
  for (const double x : {-kArm, kArm}) {
    const NodeId end = world.scene.create(body, "end");
    world.scene.edit(end).collider = Collider{ColliderShape::Primitive, PrimitiveShape::Sphere,
                                              Vec3::Constant(2 * kRadius), 0.0, 1.0};
    world.scene.set_pose(end, at(x, 0, 0));
  }
  world.scene.edit(body).rigid_body = floats;
  const NodeId ball = world.add_primitive("ball", PrimitiveShape::Sphere,
                                          Vec3::Constant(2 * kRadius), at(kArm, 0, 1.2));
  world.make_body(ball, 1.0);
  world.scene.edit(ball).collider->restitution = 1.0;
  world.scene.edit(ball).collider->friction = 0.0;
  world.backend.reset(world.scene);
  double before = 0.0;
  for (int i = 0; i < 200; ++i) {
    before = world.scene[ball].rigid_body->linear_velocity.z();
    world.backend.advance(world.scene, 1);
    if (world.scene[body].rigid_body->angular_velocity.norm() > 0.1) break;
  }
  const RigidBody& hit = *world.scene[body].rigid_body;
  // I = 2 * (2/5 m r^2 + m a^2) with m = 1 kg; impulse J = 2 v / (1/m_ball + 1/M + a^2/I).
  const double inertia = 2.0 * (0.4 * kRadius * kRadius + kArm * kArm);
  const double impulse = 2.0 * -before / (1.0 + 0.5 + kArm * kArm / inertia);
  CHECK(hit.angular_velocity.y() == Approx(impulse * kArm / inertia).epsilon(0.06));
  CHECK(hit.linear_velocity.z() == Approx(-impulse / 2.0).epsilon(0.06));
}

TEST_CASE("a body stands on the centre of its volume, not on its node's origin", "[physics]") {
  // An upright box whose node sits at one edge would fall over if the origin were the centre.
  PhysicsWorld world;
  Mesh mesh = make_box(Vec3(0.1, 0.1, 0.4));
  for (Vec3f& position : mesh.positions) position += Vec3f(3.0f, 0.0f, 0.2f);
  const NodeId node = world.add("pillar", shared(mesh), ColliderShape::ConvexHull, at(0, 0, 0.001));
  world.make_body(node);
  world.add_floor();
  world.run(120);
  CHECK((world.position(node) - Vec3(0, 0, 0)).norm() < 0.002);
}

TEST_CASE("overlapping bodies are parted without being shot away", "[physics]") {
  PhysicsWorld world;
  world.add_floor();
  std::vector<NodeId> boxes;
  for (int i = 0; i < 12; ++i) {
    const Affine pose = at(0.01 * i, 0.007 * i, 0.2 + 0.004 * i) *
                        Eigen::AngleAxisd(0.4 * i, Vec3(1, i, 2).normalized());
    boxes.push_back(world.add_primitive("box", PrimitiveShape::Box, Vec3(0.2, 0.1, 0.15), pose));
    world.make_body(boxes.back());
  }
  world.backend.reset(world.scene);
  double fastest = 0.0;
  for (int i = 0; i < 240; ++i) {
    world.backend.advance(world.scene, 1);
    for (const NodeId box : boxes) {
      fastest = std::max(fastest, world.scene[box].rigid_body->linear_velocity.norm());
    }
  }
  CHECK(fastest < 4.0);  // a fall from 0.5 m reaches 3.1 m/s
  for (const NodeId box : boxes) {
    CHECK(world.position(box).head<2>().norm() < 1.5);
    CHECK(world.position(box).z() > 0.04);
  }
  CHECK(world.backend.report().max_penetration_m < 0.002);
}

TEST_CASE("hidden nodes collide unless told otherwise", "[physics]") {
  for (const bool collide : {true, false}) {
    BulletBackend::Params params;
    params.hidden_collide = collide;
    PhysicsWorld world(params);
    const NodeId floor = world.add_floor();
    world.scene.edit(floor).is_visible = false;
    const NodeId ball =
        world.add_primitive("ball", PrimitiveShape::Sphere, Vec3::Constant(0.1), at(0, 0, 0.3));
    world.make_body(ball);
    world.run(90);
    CHECK((world.position(ball).z() > 0.0) == collide);
  }
}

TEST_CASE("bad physical properties are refused with the node's path", "[physics]") {
  PhysicsWorld world;
  const NodeId node = world.add_primitive("crate", PrimitiveShape::Box, Vec3::Ones(), at(0, 0, 0));
  world.make_body(node, -2.0);
  CHECK(error_of(world) ==
        "/crate: the mass of its rigid body is -2.000000 kg; it must be above 0");
  world.make_body(node, 1.0);
  world.scene.edit(node).collider->restitution = 1.5;
  CHECK(error_of(world).find("/crate: its collider needs") == 0);
}

TEST_CASE("a rigid body without colliders stays and is named in a warning", "[physics]") {
  PhysicsWorld world;
  const NodeId node = world.scene.create(world.scene.root(), "ghost");
  world.make_body(node);
  world.run(10);
  CHECK(world.position(node).norm() == 0.0);
  REQUIRE(world.host.warnings.size() == 1);
  CHECK(world.host.warnings[0] == "/ghost: a rigid body without colliders stays where it is");
}

TEST_CASE("degenerate meshes neither crash nor move anything", "[physics]") {
  PhysicsWorld world;
  Mesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}, {0, 0, 0}};
  world.add("line", shared(flat), ColliderShape::TriangleMesh, at(0, 0, 0));
  world.add("nothing", shared(Mesh{}), ColliderShape::TriangleMesh, at(0, 0, 0));
  world.add("nothing_box", shared(Mesh{}), ColliderShape::BoundingBox, at(0, 0, 0));
  const NodeId body = world.add("wire", shared(flat), ColliderShape::ConvexHull, at(0, 0, 1));
  world.make_body(body);
  world.add_floor();
  world.run(120);
  CHECK(world.position(body).z() == Approx(0.0).margin(0.005));
}
