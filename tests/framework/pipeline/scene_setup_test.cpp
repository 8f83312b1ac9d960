// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/scene_setup.h"

#include "fake_host.h"
#include "framework/pipeline/lamps.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

NodeId add_mesh(Scene& scene, NodeId parent, const char* name, const Vec3& position) {
  const NodeId node = scene.create(parent, name);
  scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(Vec3(0.4, 0.6, 0.8)));
  scene.set_pose(node, Transform{position, Quat::Identity(), Vec3::Ones()});
  return node;
}

/// Two nodes match "TableDining"; the first one in traversal order has its meshes below it.
void build_room(Scene& scene, NodeId root) {
  scene.set_pose(root, Transform{Vec3(10.0, 20.0, 0.0), Quat::Identity(), Vec3::Ones()});
  add_mesh(scene, root, "dining_room_exterior", Vec3::Zero());
  add_mesh(scene, root, "dining_room_ceiling", Vec3(0, 0, 3));
  const NodeId lamp = scene.create(root, "CeilingLight_001_SPLIT_GLA");
  add_mesh(scene, lamp, "glass", Vec3::Zero());
  const NodeId table = scene.create(root, "TableDiningFactory_1_spawn");
  scene.set_pose(table, Transform{Vec3(1.0, 2.0, 0.5), Quat::Identity(), Vec3::Ones()});
  add_mesh(scene, table, "top", Vec3(0, 0, 0.7));
  add_mesh(scene, root, "TableDiningFactory_2_spawn", Vec3(5, 5, 0));
}

EnvironmentRules infinigen_rules() {
  EnvironmentRules rules;
  rules.hide = {"001_SPLIT_GLA"};
  rules.hide_in_debug = {"_exterior", "_ceiling"};
  rules.box_colliders = {"TableDining"};
  rules.working_area = "TableDining";
  return rules;
}

struct BuiltRoom {
  FakeHost host;
  Scene scene;
  NodeId environment;
  BuiltRoom() {
    host.assets["room"] = build_room;
    environment = host.load_asset("room", scene, scene.create(scene.root(), "Environment"));
  }
  const Node& at(const std::string& path) {
    return scene[scene.require("/Environment/loaded/" + path)];
  }
};

}  // namespace

TEST_CASE("Walls stand hidden round the working area and leave the inside free", "[environment]") {
  BuiltRoom room;
  EnvironmentRules rules;
  rules.working_area = "TableDiningFactory_1";
  rules.walls = {4, 6, 3};
  const Vec3 centre =
      apply_environment_rules(rules, false, room.environment, room.scene, room.host);
  CHECK(centre == Vec3(11, 22, 0.5));
  const NodeId walls = room.scene.require("/Walls");
  REQUIRE(room.scene[walls].children.size() == 6);
  Aabb inside;
  inside.min = Vec3::Constant(-kInfinity);
  inside.max = Vec3::Constant(kInfinity);
  Aabb outside;
  for (const NodeId wall : room.scene[walls].children) {
    CHECK_FALSE(room.scene.is_visible(wall));
    REQUIRE(room.scene[wall].collider);
    CHECK(room.scene[wall].collider->primitive == PrimitiveShape::Box);
    const Vec3 middle = room.scene.world_from_node(wall).translation();
    Aabb box;
    box.add(middle - 0.5 * room.scene[wall].collider->primitive_size);
    box.add(middle + 0.5 * room.scene[wall].collider->primitive_size);
    CHECK(room.scene[wall].mesh->bounds().size().isApprox(box.size(), 1e-6));
    outside.add(box);
    for (int axis = 0; axis < 3; ++axis) {
      if (box.max[axis] <= centre[axis])
        inside.min[axis] = std::max(inside.min[axis], box.max[axis]);
      if (box.min[axis] >= centre[axis])
        inside.max[axis] = std::min(inside.max[axis], box.min[axis]);
    }
  }
  CHECK(inside.min.isApprox(centre - Vec3(2, 3, 1.5), 1e-9));
  CHECK(inside.max.isApprox(centre + Vec3(2, 3, 1.5), 1e-9));
  CHECK(outside.size().isApprox(Vec3(5, 7, 4), 1e-9));
}

TEST_CASE("Spheres round cameras collide and are not seen", "[environment]") {
  BuiltRoom room;
  const auto cameras = create_cameras(job_from(good_job()).cameras, room.scene);
  const auto spheres = create_camera_spheres(cameras, 0.3, room.scene);
  REQUIRE(spheres.size() == 2);
  CHECK(room.scene[spheres[1]].parent == cameras[1]);
  CHECK_FALSE(room.scene[spheres[1]].mesh);
  CHECK(room.scene[spheres[1]].collider->primitive == PrimitiveShape::Sphere);
  CHECK(room.scene[spheres[1]].collider->primitive_size == Vec3::Constant(0.6));
}

TEST_CASE("Rules hide by part of the path and find the working area in the world",
          "[environment]") {
  BuiltRoom room;
  const Vec3 area =
      apply_environment_rules(infinigen_rules(), false, room.environment, room.scene, room.host);
  CHECK((area - Vec3(11.0, 22.0, 0.5)).norm() < 1e-12);
  CHECK_FALSE(room.at("CeilingLight_001_SPLIT_GLA").is_visible);
  CHECK(room.at("dining_room_exterior").is_visible);
  CHECK(room.host.warnings.empty());
}

TEST_CASE("A star in a rule stands for anything within one name", "[environment]") {
  BuiltRoom room;
  const auto hidden_by = [&](const char* text) {
    EnvironmentRules rules;
    rules.hide = {text};
    apply_environment_rules(rules, false, room.environment, room.scene, room.host);
    std::vector<std::string> names;
    for (const NodeId node : room.scene.subtree(room.environment)) {
      if (room.scene[node].is_visible) continue;
      names.push_back(room.scene[node].name);
      room.scene.edit(node).is_visible = true;
    }
    return names;
  };
  using Names = std::vector<std::string>;
  CHECK(hidden_by("Ceiling*_GLA") == Names{"CeilingLight_001_SPLIT_GLA", "glass"});
  CHECK(hidden_by("Table*_GLA").empty());
  CHECK(hidden_by("Ceiling*ass").empty());  // "glass" is another name
  CHECK(hidden_by("T*F*1_spawn") == Names{"TableDiningFactory_1_spawn", "top"});
  CHECK(hidden_by("*").size() == 7);
}

TEST_CASE("Debug mode also hides walls and ceiling", "[environment]") {
  BuiltRoom room;
  apply_environment_rules(infinigen_rules(), true, room.environment, room.scene, room.host);
  CHECK_FALSE(room.at("dining_room_exterior").is_visible);
  CHECK_FALSE(room.at("dining_room_ceiling").is_visible);
  CHECK(room.at("TableDiningFactory_1_spawn").is_visible);
}

TEST_CASE("Every mesh collides, hidden ones too; the first table as boxes", "[environment]") {
  BuiltRoom room;
  apply_environment_rules(infinigen_rules(), true, room.environment, room.scene, room.host);
  CHECK(room.at("dining_room_ceiling").collider->shape == ColliderShape::TriangleMesh);
  CHECK(room.at("CeilingLight_001_SPLIT_GLA/glass").collider->shape == ColliderShape::TriangleMesh);
  CHECK(room.at("TableDiningFactory_1_spawn/top").collider->shape == ColliderShape::BoundingBox);
  CHECK(room.at("TableDiningFactory_2_spawn").collider->shape == ColliderShape::TriangleMesh);
  CHECK_FALSE(room.at("TableDiningFactory_1_spawn").collider);
}

TEST_CASE("Meshes that leave their box half empty get no box", "[environment]") {
  const auto shape_of = [](Mesh mesh, const Vec3& scale = Vec3::Ones()) {
    FakeHost host;
    Scene scene;
    const NodeId room = scene.create(scene.root(), "room");
    const NodeId table = scene.create(room, "TableDining");
    scene.edit(table).mesh = std::make_shared<const Mesh>(std::move(mesh));
    Transform place;
    place.scale = scale;
    scene.set_pose(table, place);
    apply_environment_rules(infinigen_rules(), false, room, scene, host);
    return scene[table].collider->shape;
  };
  const auto join = [](Mesh to, Mesh more, const Vec3& at) {
    const auto first = std::uint32_t(to.positions.size());
    for (const Vec3f& p : more.positions) to.positions.push_back(p + at.cast<float>());
    for (auto triangle : more.triangles) {
      for (std::uint32_t& corner : triangle) corner += first;
      to.triangles.push_back(triangle);
    }
    return to;
  };
  CHECK(shape_of(make_box(Vec3(1.6, 0.9, 0.04))) == ColliderShape::BoundingBox);
  // Top and legs in one mesh: a solid block would stand under its edge.
  Mesh table = make_box(Vec3(1.6, 0.9, 0.04));
  for (const double x : {-0.75, 0.75}) {
    for (const double y : {-0.4, 0.4}) {
      table = join(table, make_box(Vec3(0.05, 0.05, 0.7)), Vec3(x, y, -0.37));
    }
  }
  CHECK(shape_of(table) == ColliderShape::TriangleMesh);
  // Round: things would lie on the air at its corners.
  CHECK(shape_of(make_cylinder(0.6, 0.03, 48)) == ColliderShape::TriangleMesh);
  // Nothing is gained by exactness below a centimetre.
  const Mesh stepped =
      join(make_box(Vec3(1.6, 0.9, 0.04)), make_box(Vec3(1.61, 0.91, 0.02)), Vec3(0, 0, 0.005));
  CHECK(shape_of(stepped) == ColliderShape::BoundingBox);
  CHECK(shape_of(stepped, Vec3::Constant(10.0)) == ColliderShape::TriangleMesh);
  CHECK(shape_of(make_plane(1.0, 2.0)) == ColliderShape::BoundingBox);
}

TEST_CASE("Boxes for the whole environment warn of those that are half empty", "[environment]") {
  BuiltRoom room;
  const NodeId round = room.scene.create(room.environment, "round");
  room.scene.edit(round).mesh = std::make_shared<const Mesh>(make_cylinder(0.6, 0.03, 48));
  EnvironmentRules rules;
  rules.colliders = "bounding_box";
  apply_environment_rules(rules, false, room.environment, room.scene, room.host);
  CHECK(room.scene[round].collider->shape == ColliderShape::BoundingBox);
  REQUIRE(room.host.warnings.size() == 1);
  CHECK_THAT(room.host.warnings[0],
             ContainsSubstring("/Environment/loaded: 'environment.colliders: bounding_box' makes 1 "
                               "meshes solid where pictures show nothing"));
}

TEST_CASE("The environment's own name matches no rule", "[environment]") {
  BuiltRoom room;
  EnvironmentRules rules;
  rules.hide = {"loaded", "Environment"};
  apply_environment_rules(rules, false, room.environment, room.scene, room.host);
  for (const NodeId node : room.scene.subtree(room.environment)) {
    CHECK(room.scene[node].is_visible);
  }
}

TEST_CASE("Objects get labels, colliders and one body, and lose the asset's own", "[spawn]") {
  FakeHost host;
  host.assets["mug"] = [](Scene& scene, NodeId root) {
    scene.edit(root).labels = {{"class", "wrong"}};
    const NodeId part = add_mesh(scene, root, "part", Vec3::Zero());
    scene.edit(part).labels = {{"class", "worse"}};
    scene.edit(part).rigid_body = RigidBody{0.25};
    const NodeId round = add_mesh(scene, root, "round", Vec3::Zero());
    Collider exact;
    exact.shape = ColliderShape::Primitive;
    exact.primitive = PrimitiveShape::Sphere;
    scene.edit(round).collider = exact;
  };
  const Job job = job_from(R"(
environments: [{type: files}]
cameras: [{type: pinhole}]
objects:
  - {type: files, name: a, under: /Assets/Deep, count: 2, label: mug, taxonomy: kind}
  - {type: files, name: b, under: /Distractors, count: 1, gravity_disabled_chance: 1, mass_kg: 3}
)");
  host.assets["box"] = [](Scene& scene, NodeId root) { add_mesh(scene, root, "m", Vec3::Zero()); };
  const CapturePlan plan = plan_captures(job, {{"room", 0}}, {{"mug"}, {"box"}});
  Scene scene;
  const std::vector<NodeId> objects = spawn_objects(plan.objects, job, scene, host);
  REQUIRE(objects.size() == 3);
  CHECK(scene.path(objects[0]) == "/Assets/Deep/falling_mug");
  CHECK(scene.path(objects[1]) == "/Assets/Deep/falling_mug_01");
  CHECK(scene.path(objects[2]) == "/Distractors/floating_box");

  const Node& mug = scene[objects[0]];
  CHECK(mug.labels == Labels{{"kind", "mug"}});
  CHECK(mug.rigid_body->mass_kg == 0.25);
  CHECK(mug.rigid_body->has_gravity);
  const Node& part = scene[scene.require("/Assets/Deep/falling_mug/loaded/part")];
  CHECK(part.labels.empty());
  CHECK_FALSE(part.rigid_body);
  CHECK(part.collider->shape == ColliderShape::ConvexHull);
  const Node& round = scene[scene.require("/Assets/Deep/falling_mug/loaded/round")];
  CHECK(round.collider->shape == ColliderShape::Primitive);

  const Node& box = scene[objects[2]];
  CHECK(box.labels.empty());
  CHECK(box.rigid_body->mass_kg == 3.0);
  CHECK_FALSE(box.rigid_body->has_gravity);
}

namespace {

/// A chest and its drawer, side by side, with a joint between them.
void build_chest(Scene& scene, NodeId root) {
  const NodeId body = add_mesh(scene, root, "body", Vec3::Zero());
  const NodeId drawer = add_mesh(scene, root, "drawer_1", Vec3(0, 0, 0.1));
  scene.edit(body).rigid_body = RigidBody{8.0};
  scene.edit(drawer).rigid_body = RigidBody{2.0};
  const NodeId slide = scene.create(root, "drawer_slide");
  Joint joint;
  joint.kind = JointKind::Prismatic;
  joint.parent_body = body;
  joint.child_body = drawer;
  scene.edit(slide).joint = joint;
}

Job chest_job(const std::string& words) {
  return job_from(R"(
environments: [{type: files}]
cameras: [{type: pinhole}]
objects:
  - {type: files, name: chests, under: /Assets, label: chest, )" +
                  words + "}\n");
}

}  // namespace

TEST_CASE("Parts get labels by name; joints hold as the job says", "[spawn]") {
  FakeHost host;
  host.assets["chest"] = build_chest;
  for (const bool is_free : {false, true}) {
    const Job job =
        chest_job(std::string("parts: {drawer_*: drawer}, joints: ") + (is_free ? "free" : "held"));
    const CapturePlan plan = plan_captures(job, {{"room", 0}}, {{"chest"}});
    Scene scene;
    const NodeId object = spawn_objects(plan.objects, job, scene, host).front();
    const std::string path = scene.path(object) + "/loaded/";
    CHECK(scene[object].labels == Labels{{"class", "chest"}});
    CHECK(scene[scene.require(path + "drawer_1")].labels == Labels{{"class", "drawer"}});
    CHECK(scene[scene.require(path + "body")].labels.empty());
    CHECK(scene[scene.require(path + "drawer_slide")].labels.empty());
    // The body that nothing holds is the object's own.
    CHECK(scene[object].rigid_body->mass_kg == (is_free ? 8.0 : 10.0));
    CHECK_FALSE(scene[scene.require(path + "body")].rigid_body);
    CHECK(scene[scene.require(path + "drawer_1")].rigid_body.has_value() == is_free);
  }
}

TEST_CASE("What is fixed to where an object begins is the object", "[spawn]") {
  FakeHost host;
  host.assets["chest"] = [](Scene& scene, NodeId root) {
    build_chest(scene, root);
    // As models begin: an empty node, and what is fixed to it.
    const NodeId base = scene.create(root, "base");
    const NodeId holder = scene.create(root, "base_fixed");
    Joint joint;
    joint.parent_body = base;
    joint.child_body = scene.find(scene.path(root) + "/body");
    scene.edit(holder).joint = joint;
  };
  const Job job = chest_job("joints: free");
  const CapturePlan plan = plan_captures(job, {{"room", 0}}, {{"chest"}});
  Scene scene;
  const NodeId object = spawn_objects(plan.objects, job, scene, host).front();
  const std::string path = scene.path(object) + "/loaded/";
  CHECK(scene[object].rigid_body->mass_kg == 8.0);
  CHECK_FALSE(scene[scene.require(path + "body")].rigid_body);
  CHECK(scene[scene.require(path + "drawer_1")].rigid_body);
}

TEST_CASE("Articulated furniture of the environment stands still unless joints are free",
          "[environment]") {
  for (const bool is_free : {false, true}) {
    FakeHost host;
    Scene scene;
    const NodeId environment = scene.create(scene.root(), "Environment");
    build_chest(scene, environment);
    const NodeId ball = add_mesh(scene, environment, "ball", Vec3(0, 0, 2));
    scene.edit(ball).rigid_body = RigidBody{};
    EnvironmentRules rules;
    rules.joints = is_free ? "free" : "held";
    apply_environment_rules(rules, false, environment, scene, host);
    CHECK(scene[scene.require("/Environment/body")].rigid_body.has_value() == is_free);
    CHECK(scene[scene.require("/Environment/drawer_1")].rigid_body.has_value() == is_free);
    CHECK(scene[ball].rigid_body);
  }
}

TEST_CASE("Labels of parts that are none are named", "[spawn]") {
  CHECK_THROWS_WITH(chest_job("parts: [drawer]"),
                    ContainsSubstring("parts: expected labels by name, {drawer_*: drawer}, found"));
  CHECK_THROWS_WITH(chest_job("parts: {drawer: [a]}"),
                    ContainsSubstring("parts.drawer: expected a label, found"));
  CHECK_THROWS_WITH(chest_job("parts: {a/b: c}"),
                    ContainsSubstring("parts: expected names in which * stands for anything"));
}

TEST_CASE("Lights and cameras stand where the job says", "[spawn]") {
  FakeHost host;
  const Job job = job_from(R"(
environments: [{type: files}]
lights:
  - {type: sphere, name: lamp, count: 2, color: [1, 0.5, 0.25], intensity: 8, position: [1, 2, 3]}
  - {type: dome, name: sky, texture: sky.hdr}
  - {type: distant, name: sun, angle_deg: 90, rotation_deg: [0, 90, 0]}
cameras:
  - {type: pinhole, name: left, width: 300, height: 200, position: [0, 0, 2], look_at: [0, 5, 2]}
  - {type: opencv_pinhole, name: right, count: 2, width: 300, height: 200, fx_px: 250, fy_px: 240,
     cx_px: 140, cy_px: 90, distortion: [0.1, 0.2]}
)");
  Scene scene;
  create_lights(job.lights, scene, host);
  const Node& lamp = scene[scene.require("/Lights/lamp_1")];
  CHECK(lamp.light->color == Vec3f(8, 4, 2));
  CHECK(lamp.parent_from_node.translation() == Vec3(1, 2, 3));
  CHECK(scene[scene.require("/Lights/sky_0")].light->texture->name == "sky.hdr");
  const Node& sun = scene[scene.require("/Lights/sun_0")];
  CHECK(sun.light->angle_rad == Approx(kPi / 2));
  CHECK((sun.parent_from_node.linear() * Vec3(0, 0, -1) - Vec3(-1, 0, 0)).norm() < 1e-12);

  const std::vector<NodeId> cameras = create_cameras(job.cameras, scene);
  REQUIRE(cameras.size() == 3);
  CHECK(scene.path(cameras[0]) == "/Cameras/left_0");
  CHECK(scene.path(cameras[2]) == "/Cameras/right_1");
  const Affine& left = scene[cameras[0]].parent_from_node;
  CHECK((left.linear() * Vec3(0, 0, -1) - Vec3(0, 1, 0)).norm() < 1e-12);
  CHECK((left.linear() * Vec3(0, 1, 0) - Vec3(0, 0, 1)).norm() < 1e-12);
  CHECK(scene[cameras[0]].camera->fx == Approx(300 * 24.0 / 20.955));
  const Camera& right = *scene[cameras[1]].camera;
  CHECK(right.lens == LensModel::OpencvPinhole);
  CHECK(right.fx == 250);
  CHECK(right.fy == 240);
  CHECK(right.cx == 140);
  CHECK(right.cy == 90);
  CHECK(right.distortion[1] == 0.2);
  CHECK(right.near_m == 0.25);
}

TEST_CASE("Lamps of the environment are dimmed to a limit, each by itself", "[environment]") {
  BuiltRoom room;
  const auto add_lamp = [&](const char* name, float nits) {
    const NodeId node = room.scene.create(room.environment, name);
    Light light;
    light.radius_m = 0.1;
    light.color = Vec3f(nits, nits, 0.5f * nits);
    room.scene.edit(node).light = light;
    return node;
  };
  const NodeId harsh = add_lamp("harsh", 3e8f);
  const NodeId mild = add_lamp("mild", 2000.0f);
  const NodeId hidden = add_lamp("hidden_exterior", 3e8f);
  room.scene.edit(hidden).is_visible = false;
  Light sky;
  sky.kind = LightKind::Dome;
  sky.color = Vec3f::Constant(1e6f);
  const NodeId dome = room.scene.create(room.environment, "sky");
  room.scene.edit(dome).light = sky;
  // Two boxes share a glowing material; one is ten times as large.
  auto glow = std::make_shared<Material>();
  glow->emission = Vec3f::Constant(1e5f);
  std::vector<NodeId> boxes;
  for (const double size : {0.1, 1.0}) {
    const NodeId box = room.scene.create(room.environment, "box");
    room.scene.edit(box).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
    room.scene.edit(box).materials = {glow};
    boxes.push_back(box);
  }
  EnvironmentRules rules;
  rules.max_lamp_lux = 500.0;
  apply_environment_rules(rules, false, room.environment, room.scene, room.host);

  const double before = 3e8 * (0.2126 + 0.7152 + 0.0361) * kPi * 0.01 / 4.0;
  CHECK(lamp_lux(room.scene, harsh) == Approx(500.0));
  CHECK(double(room.scene[harsh].light->color.x()) == Approx(3e8 * 500.0 / before));
  CHECK(room.scene[mild].light->color == Vec3f(2000.0f, 2000.0f, 1000.0f));
  CHECK(room.scene[hidden].light->color.x() == 3e8f);
  CHECK(room.scene[dome].light->color.x() == 1e6f);
  // 6 x 0.01 m^2 x 1e5 nits / 4 / 4 = 375 lux stay; 37,500 do not.
  CHECK(room.scene[boxes[0]].materials[0] == glow);
  CHECK(lamp_lux(room.scene, boxes[1]) == Approx(500.0).epsilon(1e-4));
  CHECK(glow->emission.x() == 1e5f);
  CHECK(room.host.warnings.empty());
}

TEST_CASE("The cameras of a rig keep their places in it wherever it goes", "[spawn]") {
  const Job job = job_from(
      with(good_job(), "cameras: [{type: pinhole, name: cam, count: 2, width: 64, height: 48}]",
           R"(cameras:
  - type: pinhole
    name: head
    count: 2
    width: 64
    height: 48
    position: [1, 2, 3]
    look_at: [1, 5, 3]
    rig:
      - {name: left, position: [-0.06, 0, 0]}
      - {name: depth, position: [0.03, 0.02, 0], rotation_deg: [0, -90, 0], width: 32, fx_px: 40}
      - {name: ring, position: [0, 0, -0.5], count: 4})"));
  Scene scene;
  const std::vector<NodeId> cameras = create_cameras(job.cameras, scene);
  std::vector<std::string> paths;
  for (const NodeId camera : cameras) paths.push_back(scene.path(camera));
  REQUIRE(paths.size() == 12);
  CHECK(paths[0] == "/Cameras/head_0/head_0_left");
  CHECK(paths[2] == "/Cameras/head_0/head_0_ring_0");
  CHECK(paths[11] == "/Cameras/head_1/head_1_ring_3");
  CHECK(job.camera_names()[11] == "head_1_ring_3");
  const NodeId rig = scene.require("/Cameras/head_0");
  CHECK_FALSE(scene[rig].camera);
  CHECK(scene[cameras[0]].camera->width == 64);
  CHECK(scene[cameras[1]].camera->width == 32);
  CHECK(scene[cameras[1]].camera->height == 48);
  CHECK(scene[cameras[1]].camera->fx == 40.0);
  // Looking along +y: right is +x, back is -y.
  const auto place = [&](std::size_t i) {
    return Vec3(scene.world_from_node(cameras[i]).translation());
  };
  const auto forward = [&](std::size_t i) {
    return Vec3(-scene.world_from_node(cameras[i]).linear().col(2));
  };
  CHECK((place(0) - Vec3(0.94, 2, 3)).norm() < 1e-9);
  CHECK((forward(0) - Vec3(0, 1, 0)).norm() < 1e-9);
  CHECK((place(1) - Vec3(1.03, 2, 3.02)).norm() < 1e-9);
  CHECK((forward(1) - Vec3(1, 0, 0)).norm() < 1e-9);
  // Outwards: ahead, right, back, left.
  const Vec3 ways[] = {{0, 1, 0}, {1, 0, 0}, {0, -1, 0}, {-1, 0, 0}};
  for (std::size_t k = 0; k < 4; ++k) {
    CHECK((place(2 + k) - Vec3(1, 2, 3) - 0.5 * ways[k]).norm() < 1e-9);
    CHECK((forward(2 + k) - ways[k]).norm() < 1e-9);
  }
  scene.set_pose(rig, Affine(Eigen::Translation3d(0, 0, 10)));
  CHECK((place(0) - Vec3(-0.06, 0, 10)).norm() < 1e-9);
}

TEST_CASE("The overview camera looks straight down at the working area", "[spawn]") {
  Scene scene;
  const Vec3 area(3.0, -2.0, 0.75);
  const NodeId camera = create_overview_camera(area, scene);
  const Affine world_from_camera = scene.world_from_node(camera);
  const auto pixel =
      project(*scene[camera].camera, world_from_camera.inverse() * Vec3(3.0, -2.0, 0.75));
  REQUIRE(pixel);
  CHECK((*pixel - Vec2(384, 384)).norm() < 1e-9);
  // +y of the world is up in the picture, +x to the right.
  const auto up =
      project(*scene[camera].camera, world_from_camera.inverse() * Vec3(3.0, -1.0, 0.75));
  CHECK(up->y() < 383);
  const auto right =
      project(*scene[camera].camera, world_from_camera.inverse() * Vec3(4.0, -2.0, 0.75));
  CHECK(right->x() > 385);
}
