// SPDX-License-Identifier: Apache-2.0
#include <cmath>
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
    // A ball may still roll.
    const auto is_fast = [&](NodeId node) {
      return world.scene[node].rigid_body->linear_velocity.norm() > 0.1;
    };
    CHECK(std::count_if(things.begin(), things.end(), is_fast) <= 1);
    CHECK(late.max_speed < 0.3);
  }
}

TEST_CASE("nothing stays in balance on an edge or a corner, and what is round stays where it lies",
          "[physics]") {
  struct Thing {
    const char* name;
    Mesh mesh;
    ColliderShape shape;
    double tilt;    ///< That puts its centre over the edge.
    double height;  ///< Of its centre, then.
    bool stays;
  };
  const double edge_of_can = std::atan2(0.05, 0.07);
  const double edge_of_box = std::atan2(0.04, 0.1);
  const std::vector<Thing> things{
      {"can on its rim", make_cylinder(0.05, 0.14, 48), ColliderShape::ConvexHull, edge_of_can,
       std::hypot(0.05, 0.07), false},
      {"box on its edge", make_box(Vec3(0.08, 0.06, 0.2)), ColliderShape::BoundingBox, edge_of_box,
       std::hypot(0.04, 0.1), false},
      {"can lying", make_cylinder(0.05, 0.14, 48), ColliderShape::ConvexHull, kPi / 2, 0.05, true},
      {"can standing", make_cylinder(0.05, 0.14, 48), ColliderShape::ConvexHull, 0.0, 0.07, true},
      {"ball", make_sphere(0.06, 48), ColliderShape::BoundingSphere, 0.0, 0.06, true}};
  for (const Thing& thing : things) {
    for (const double off_deg : {-0.3, 0.0, 0.2}) {
      PhysicsWorld world;
      world.add_floor();
      const NodeId node =
          world.add("thing", shared(thing.mesh), thing.shape,
                    at(0, 0, thing.height + 0.001) *
                        Eigen::AngleAxisd(thing.tilt + off_deg * kPi / 180.0, Vec3::UnitY()));
      world.make_body(node, 0.5);
      world.run(60 * 6);
      CAPTURE(thing.name, off_deg, world.position(node).transpose());
      CHECK((std::abs(world.position(node).z() - thing.height) < 0.004) == thing.stays);
      CHECK(world.backend.report().max_speed < 0.03);
    }
  }
}

TEST_CASE("a cylinder that rolls is slowed by rolling friction, on a box and on triangles",
          "[physics]") {
  constexpr double kRadius = 0.038;
  constexpr double kSpeed = 0.2;
  // The lever is a share of the ball round the shape, and friction is 0.5 on both sides.
  const double lever = 0.02 * std::hypot(kRadius, kRadius) * std::sqrt(0.5);
  const double brake = lever / kRadius * 9.81 / 1.5;  // m/s^2; a cylinder's inertia is m r^2 / 2
  const double way = 0.5 * kSpeed * kSpeed / brake;
  for (const ColliderShape floor : {ColliderShape::BoundingBox, ColliderShape::TriangleMesh}) {
    PhysicsWorld world;
    world.add("floor", shared(make_box(Vec3(8, 8, 1))), floor, at(0, 0, -0.5));
    const Affine pose = turned(Vec3(0.013, 0.017, kRadius + 1e-3), kPi / 2, Vec3::UnitX());
    const NodeId node = world.add_primitive("cylinder", PrimitiveShape::Cylinder,
                                            Vec3::Constant(2.0 * kRadius), pose);
    world.make_body(node, 0.3);
    RigidBody& body = *world.scene.edit(node).rigid_body;
    body.linear_velocity = kSpeed * Vec3::UnitX();
    body.angular_velocity = kSpeed / kRadius * Vec3::UnitY();
    world.run(4 * 60);
    CAPTURE(int(floor), world.position(node).transpose(), way);
    const double rolled = world.position(node).x() - pose.translation().x();
    // Contacts are found some millimetres beside the line that touches.
    CHECK(rolled > 0.5 * way);
    CHECK(rolled < 2.0 * way);
    CHECK(world.scene[node].rigid_body->linear_velocity.norm() < 0.001);
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

namespace {

/// A level square of squares of 5 mm, in an order in which neighbours are far from each other.
Mesh fine_floor(int squares) {
  Mesh mesh;
  const int corners = squares + 1;
  for (int i = 0; i < corners * corners; ++i) {
    mesh.positions.push_back(
        5e-3f * Vec3f(float(i % corners - squares / 2), float(i / corners - squares / 2), 0.0f));
  }
  const int count = squares * squares;
  for (int i = 0; i < count; ++i) {
    const int square = int(std::int64_t(i) * 7919 % count);
    const auto a = std::uint32_t(square / squares * corners + square % squares);
    const std::uint32_t c = a + std::uint32_t(corners);
    mesh.triangles.push_back({a, a + 1, c + 1});
    mesh.triangles.push_back({a, c + 1, c});
  }
  return mesh;
}

/// A box that leans: its top is shifted along x.
Mesh leaning_box(const Vec3& size, float shift) {
  Mesh mesh = make_box(size);
  for (Vec3f& position : mesh.positions) {
    if (position.z() > 0.0f) position.x() += shift;
  }
  return mesh;
}

}  // namespace

TEST_CASE("what stands on thousands of triangles stands as on two", "[physics]") {
  struct Case {
    const char* name;
    Mesh mesh;
    double half_height;
  };
  const std::vector<Case> cases{
      {"a board", make_box(Vec3(0.34, 0.23, 0.02)), 0.01},
      {"a crate", make_box(Vec3(0.4, 0.4, 0.3)), 0.15},
      // Its centre of mass is 20 mm from falling over.
      {"a leaning box", leaning_box(Vec3(0.2, 0.2, 0.3), 0.16f), 0.15},
  };
  for (const Case& c : cases) {
    for (const bool is_fine : {false, true}) {
      CAPTURE(c.name, is_fine);
      PhysicsWorld world;
      world.add("floor", shared(is_fine ? fine_floor(140) : sheet(0.7, 0.7)),
                ColliderShape::TriangleMesh, at(0, 0, 0));
      const Affine pose = turned(Vec3(0.012, -0.021, c.half_height + 4e-3), 0.4, Vec3::UnitZ());
      const NodeId thing = world.add("thing", shared(c.mesh), ColliderShape::ConvexHull, pose);
      world.make_body(thing);
      world.run(240);
      CHECK(world.position(thing).z() == Approx(c.half_height).margin(2.5e-3));
      const Eigen::Matrix3d turn =
          world.scene.world_from_node(thing).linear() * pose.linear().transpose();
      CHECK(Eigen::AngleAxisd(turn).angle() < 0.01);
      CHECK(world.scene[thing].rigid_body->linear_velocity.norm() < 1e-3);
      CHECK((world.position(thing) - pose.translation()).head<2>().norm() < 2e-3);
    }
  }
}

TEST_CASE("a hull gets out of a mesh of thousands of triangles", "[physics]") {
  PhysicsWorld world;
  world.add("floor", shared(fine_floor(140)), ColliderShape::TriangleMesh, at(0, 0, 0));
  const NodeId crate =
      world.add("crate", shared(make_box(Vec3(0.4, 0.4, 0.3))), ColliderShape::ConvexHull,
                turned(Vec3(0, 0, 0.13), 0.4, Vec3::UnitZ()));
  world.make_body(crate);
  world.run(240);
  CHECK(world.position(crate).z() == Approx(0.15).margin(2.5e-3));
  CHECK(world.backend.report().max_penetration_m < 1e-3);
}

namespace {

/// Things on each other, from a millimetre above each other on.
struct Stack {
  const char* name;
  bool is_hull = false;
  PrimitiveShape shape = PrimitiveShape::Box;
  Vec3 size = Vec3::Constant(0.1);
  int count = 6;
  double turn_deg = 0.0;  ///< Of each against the one below.
  double offset_m = 0.0;  ///< Of every other one, sideways.
  double top_mass_kg = 0.3;
};

std::vector<NodeId> add_stack(PhysicsWorld& world, const Stack& stack) {
  world.add_floor();
  std::vector<NodeId> things;
  double z = 0.0;
  for (int i = 0; i < stack.count; ++i) {
    z += 1e-3;
    const Vec3 place(stack.offset_m * (i % 2), 0.5 * stack.offset_m * (i % 3),
                     z + 0.5 * stack.size.z());
    const Affine pose = turned(place, kPi / 180.0 * stack.turn_deg * i, Vec3::UnitZ());
    if (stack.is_hull) {
      things.push_back(
          world.add("thing", shared(make_box(stack.size)), ColliderShape::ConvexHull, pose));
    } else {
      things.push_back(world.add_primitive("thing", stack.shape, stack.size, pose));
    }
    world.make_body(things.back(), i + 1 == stack.count ? stack.top_mass_kg : 0.3);
    z += stack.size.z();
  }
  return things;
}

}  // namespace

TEST_CASE("stacks neither creep nor fall, whatever they are of and however they are turned",
          "[physics]") {
  const Stack stacks[] = {
      {.name = "aligned", .count = 8},
      {.name = "turned by 2", .turn_deg = 2.0},
      {.name = "turned by 7", .turn_deg = 7.0},
      {.name = "turned by 15", .count = 8, .turn_deg = 15.0},
      {.name = "turned by 45", .count = 8, .turn_deg = 45.0},
      {.name = "ten", .count = 10, .turn_deg = 11.0},
      {.name = "heavy on light", .turn_deg = 11.0, .top_mass_kg = 3.0},
      {.name = "off", .turn_deg = 11.0, .offset_m = 0.02},
      {.name = "books", .size = {0.2, 0.15, 0.03}, .count = 8, .turn_deg = 11.0, .offset_m = 0.004},
      {.name = "small", .size = {0.03, 0.03, 0.02}, .turn_deg = 11.0, .offset_m = 0.001},
      {.name = "cylinders",
       .shape = PrimitiveShape::Cylinder,
       .size = {0.08, 0.08, 0.1},
       .offset_m = 0.003},
      {.name = "hulls", .is_hull = true, .count = 8},
      {.name = "turned hulls", .is_hull = true, .count = 8, .turn_deg = 15.0},
      {.name = "heavy hull on light ones", .is_hull = true, .turn_deg = 11.0, .top_mass_kg = 3.0},
  };
  for (const Stack& stack : stacks) {
    CAPTURE(stack.name);
    PhysicsWorld world;
    const std::vector<NodeId> things = add_stack(world, stack);
    std::vector<Vec3> start;
    for (const NodeId thing : things) start.push_back(world.position(thing));
    world.run(12 * 60);
    for (std::size_t i = 0; i < things.size(); ++i) {
      CAPTURE(i);
      const Vec3 way = world.position(things[i]) - start[i];
      CHECK(way.head<2>().norm() < 0.003);
      CHECK(std::abs(way.z()) < 0.001 * double(i + 1) + 0.0015);
    }
    CHECK(world.backend.report().sleeping_bodies == stack.count);
  }
}

TEST_CASE("what lies on a slope too steep for friction slides, and stays on a flat one",
          "[physics]") {
  const auto way_on = [](double angle_deg, double friction) {
    PhysicsWorld world;
    const Affine slope(Eigen::AngleAxisd(kPi / 180.0 * angle_deg, Vec3::UnitY()));
    const NodeId floor =
        world.add_primitive("slope", PrimitiveShape::Box, Vec3(8, 2, 0.2), slope * at(0, 0, -0.1));
    const NodeId box = world.add_primitive("box", PrimitiveShape::Box, Vec3(0.1, 0.1, 0.1),
                                           slope * at(0, 0, 0.051));
    world.make_body(box);
    for (const NodeId node : {floor, box}) world.scene.edit(node).collider->friction = friction;
    const Vec3 start = world.position(box);
    world.run(60);
    return (world.position(box) - start).norm();
  };
  // tan 20 = 0.364
  CHECK(way_on(20.0, 0.5) < 0.002);
  // g (sin 20 - 0.2 cos 20) / 2 in the first second.
  CHECK(way_on(20.0, 0.2) == Approx(0.755).epsilon(0.05));
}
