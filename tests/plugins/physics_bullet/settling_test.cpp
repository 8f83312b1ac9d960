// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "diorama/rng.h"
#include "physics_world.h"
#include "support/catch.h"
#include "support/exact_bounds.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr double kTableTop = 0.75;

/// A quad of two triangles without thickness: the hardest thing to fall onto.
Mesh sheet(double width, double length) { return make_plane(width, length); }

Affine turned(const Vec3& at_point, double angle, const Vec3& axis) {
  return Affine(Eigen::Translation3d(at_point) * Eigen::AngleAxisd(angle, axis));
}

/// Four walls, a floor and a table; floor and walls are single sheets of triangles, the table top
/// is a box as jobs make it by default.
void add_room(PhysicsWorld& world) {
  const auto floor = shared(sheet(5, 4));
  const auto wall = shared(sheet(6, 6));
  const auto mesh = ColliderShape::TriangleMesh;
  world.add("floor", floor, mesh, at(0, 0, 0));
  world.add("wall", wall, mesh, turned(Vec3(-2.5, 0, 1.5), kPi / 2, Vec3::UnitY()));
  world.add("wall", wall, mesh, turned(Vec3(2.5, 0, 1.5), -kPi / 2, Vec3::UnitY()));
  world.add("wall", wall, mesh, turned(Vec3(0, -2, 1.5), -kPi / 2, Vec3::UnitX()));
  world.add("wall", wall, mesh, turned(Vec3(0, 2, 1.5), kPi / 2, Vec3::UnitX()));
  world.add("table", shared(make_box(Vec3(1.6, 0.9, kTableTop))), ColliderShape::BoundingBox,
            at(0.2, -0.1, 0.5 * kTableTop));
}

struct Assortment {
  std::vector<std::shared_ptr<const Mesh>> meshes{
      shared(make_capsule(0.5, 1.0, 32)), shared(make_cone(1, 2, 32)),
      shared(make_cylinder(1, 2, 32)), shared(make_sphere(1, 32)), shared(make_box(Vec3(2, 2, 2)))};
  std::vector<Vec3> sizes{{1, 1, 2}, {2, 2, 2}, {2, 2, 2}, {2, 2, 2}, {2, 2, 2}};
  std::vector<PrimitiveShape> kinds{PrimitiveShape::Capsule, PrimitiveShape::Cone,
                                    PrimitiveShape::Cylinder, PrimitiveShape::Sphere,
                                    PrimitiveShape::Box};
};

/// Primitives of 2 m, scaled to 2 to 20 cm, dropped from 1 to 2 m above the table top.
std::vector<NodeId> add_clutter(PhysicsWorld& world, const Assortment& assortment, int count,
                                Rng rng) {
  std::vector<NodeId> nodes;
  const Aabb box{Vec3(-1.3, -1.6, kTableTop + 1.0), Vec3(1.7, 1.4, kTableTop + 2.0)};
  for (int i = 0; i < count; ++i) {
    const std::size_t kind = rng.index(5);
    Transform pose;
    pose.translation = rng.uniform_in(box);
    pose.rotation = rng.uniform_rotation();
    pose.scale = Vec3::Constant(rng.uniform(0.01, 0.1));
    const bool is_exact = rng.chance(0.5);
    const NodeId node =
        world.add("thing", assortment.meshes[kind],
                  is_exact ? ColliderShape::Primitive : ColliderShape::ConvexHull, pose.affine());
    if (is_exact) {
      world.scene.edit(node).collider->primitive = assortment.kinds[kind];
      world.scene.edit(node).collider->primitive_size = assortment.sizes[kind];
    }
    world.make_body(node, 0.3);
    nodes.push_back(node);
  }
  return nodes;
}

void check_in_room(const PhysicsWorld& world, const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const Aabb box = exact_bounds(world.scene, node);
    INFO(world.scene.path(node) << " at " << world.position(node).transpose());
    // A hull of 64 corners lies up to 8 mm inside a ball of 18 cm.
    CHECK(box.min.z() > -0.009);
    CHECK(box.min.x() > -2.51);
    CHECK(box.max.x() < 2.51);
    CHECK(box.min.y() > -2.01);
    CHECK(box.max.y() < 2.01);
  }
}

/// Bodies whose centre lies in the table.
int count_in_table(const PhysicsWorld& world, const std::vector<NodeId>& nodes) {
  const Aabb table{Vec3(-0.6, -0.55, 0.0), Vec3(1.0, 0.35, kTableTop)};
  int count = 0;
  for (const NodeId node : nodes) {
    const Vec3 centre = world.scene.world_bounds(node).centre();
    const bool is_inside = (centre.array() > table.min.array() + 0.002).all() &&
                           (centre.array() < table.max.array() - 0.002).all();
    count += is_inside ? 1 : 0;
  }
  return count;
}

std::string poses_of(const PhysicsWorld& world, const std::vector<NodeId>& nodes) {
  std::string bytes;
  for (const NodeId node : nodes) {
    const Mat4 matrix = world.scene.world_from_node(node).matrix();
    bytes.append(reinterpret_cast<const char*>(matrix.data()), sizeof(double) * 16);
  }
  return bytes;
}

}  // namespace

TEST_CASE("hundreds of small things fall into a room and come to rest in it", "[physics][slow]") {
  const Assortment assortment;
  for (const std::uint64_t seed : {1u, 2u, 3u, 6u}) {
    PhysicsWorld world;
    add_room(world);
    const std::vector<NodeId> things = add_clutter(world, assortment, 150, Rng(seed));
    world.run(204);
    check_in_room(world, things);
    CHECK(count_in_table(world, things) == 0);
    const PhysicsReport early = world.backend.report();
    CAPTURE(early.max_speed, early.max_penetration_m, early.deepest_body);
    CHECK(early.moving_bodies == 150);
    CHECK(early.max_speed < 0.5);
    CHECK(early.max_penetration_m < 0.005);
    world.backend.advance(world.scene, 200);
    check_in_room(world, things);
    CHECK(count_in_table(world, things) == 0);
    const PhysicsReport late = world.backend.report();
    CAPTURE(late.max_speed, late.sleeping_bodies, late.deepest_body);
    CHECK(late.max_penetration_m < 0.002);
    CHECK(late.max_speed < 0.1);
  }
}

TEST_CASE("small things neither tunnel at speed nor through sheets", "[physics]") {
  // 60 Hz without sub-steps, spheres of 1 cm at 8 m/s: 13 cm per step.
  BulletBackend::Params params;
  params.sub_steps = 1;
  PhysicsWorld world(params);
  world.add("floor", shared(sheet(4, 4)), ColliderShape::TriangleMesh, at(0, 0, 0));
  std::vector<NodeId> balls;
  for (int i = 0; i < 100; ++i) {
    balls.push_back(world.add_primitive("ball", PrimitiveShape::Sphere, Vec3::Constant(0.01),
                                        at(-1.5 + 0.03 * i, -1.2 + 0.017 * i, 3.0 + 0.013 * i)));
    world.make_body(balls.back(), 0.01);
  }
  world.run(120);
  for (const NodeId ball : balls) CHECK(world.position(ball).z() > 0.0);
}

TEST_CASE("same scene, same bits, whatever the backend did before", "[physics]") {
  const Assortment assortment;
  const auto run = [&](PhysicsWorld& world, std::uint64_t seed) {
    world.scene = Scene();
    add_room(world);
    const auto things = add_clutter(world, assortment, 40, Rng(seed));
    world.backend.reset(world.scene);
    world.backend.advance(world.scene, 4);
    (void)world.backend.report();
    world.backend.advance(world.scene, 100);
    return poses_of(world, things);
  };
  PhysicsWorld fresh;
  const std::string first = run(fresh, 3);
  PhysicsWorld other;
  run(other, 4);  // fills the cache of shapes with other things
  CHECK(run(other, 3) == first);
  CHECK(run(other, 3) == first);

  PhysicsWorld split;
  add_room(split);
  const auto things = add_clutter(split, assortment, 40, Rng(3));
  split.backend.reset(split.scene);
  for (int i = 0; i < 104; ++i) split.backend.advance(split.scene, 1);
  CHECK(poses_of(split, things) == first);
}

TEST_CASE("a capsule comes to rest lying, on a mesh, on a box and half over an edge", "[physics]") {
  for (const ColliderShape shape : {ColliderShape::TriangleMesh, ColliderShape::BoundingBox}) {
    PhysicsWorld world;
    world.add("floor", shared(make_box(Vec3(2, 2, 1))), shape, at(0, 0, -0.5));
    const auto leaning = [](const Vec3& place, double angle) {
      return Affine(Eigen::Translation3d(place) *
                    Eigen::AngleAxisd(angle, Vec3(0.2, 1, 0).normalized()));
    };
    std::vector<NodeId> capsules;
    for (const Affine& pose :
         {leaning(Vec3(0, 0, 0.3), 1.3), leaning(Vec3(0.93, 0.5, 0.06), 1.55)}) {
      capsules.push_back(
          world.add_primitive("capsule", PrimitiveShape::Capsule, Vec3(0.1, 0.1, 0.3), pose));
      world.make_body(capsules.back());
    }
    world.run(600);
    CAPTURE(int(shape));
    CHECK(world.position(capsules[0]).z() == Approx(0.05).margin(0.001));
    const Vec3 axis = world.scene.world_from_node(capsules[0]).linear().col(2);
    CHECK(std::abs(axis.z()) < 0.01);
    CHECK(world.scene[capsules[0]].rigid_body->linear_velocity.norm() < 0.01);
    CHECK(world.position(capsules[1]).z() == Approx(0.05).margin(0.002));
    CHECK(world.backend.report().max_penetration_m < 0.001);
  }
}
