// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "diorama/joints.h"
#include "diorama/plugin.h"
#include "framework/export/scene_export.h"
#include "framework/host/host_services.h"
#include "loader_dining_room/dining_room.h"
#include "loader_samples/samples_loader.h"
#include "loader_usd/usd_loader.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

void register_usd(Registrar& registrar) {
  diorama::add<loader_usd::UsdLoader>(registrar, "usd", "Loads USD.");
}

struct Workshop {
  Workshop() : registry({}, [](LogLevel, std::string_view) {}) {
    std::string pattern = (fs::temp_directory_path() / "diorama_export_XXXXXX").string();
    folder = mkdtemp(pattern.data());
    registry.add_builtin(register_usd, "1.0.0");
    host = std::make_unique<HostServices>(registry, HostOptions{std::nullopt, {}, 2},
                                          [this](LogLevel level, std::string_view text) {
                                            if (level >= LogLevel::Warning)
                                              warnings.emplace_back(text);
                                          });
  }
  ~Workshop() { fs::remove_all(folder); }

  /// Exports what is below `root` and loads it back.
  NodeId there_and_back(const Scene& scene, NodeId root, const char* file, Scene& loaded) {
    export_scene(scene, root, folder / file, {}, *host);
    return host->load_asset((folder / file).string(), loaded, loaded.root());
  }

  fs::path folder;
  Registry registry;
  std::vector<std::string> warnings;
  std::unique_ptr<HostServices> host;
};

/// All leaves with something in them, by their path below the root; the loader may put groups of
/// its own above.
std::map<std::string, NodeId> things(const Scene& scene, NodeId root) {
  std::map<std::string, NodeId> found;
  const std::string above = scene.path(root);
  for (const NodeId id : scene.subtree(root)) {
    const Node& node = scene[id];
    if (!node.mesh && !node.light && !node.camera) continue;
    std::string path = scene.path(id).substr(above.size());
    if (path.starts_with("/World")) path = path.substr(6);
    found.emplace(path, id);
  }
  return found;
}

/// Corner by corner: vertices may be stored differently.
void compare_meshes(const Mesh& a, const Mesh& b) {
  REQUIRE(a.triangles.size() == b.triangles.size());
  CHECK(a.is_double_sided == b.is_double_sided);
  std::size_t unequal = 0;
  for (std::size_t t = 0; t < a.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t i = a.triangles[t][k], j = b.triangles[t][k];
      unequal += a.positions[i] != b.positions[j];
      unequal += (a.normals[i] - b.normals[j]).norm() > 1e-6f;
      unequal += a.uvs[i] != b.uvs[j];
    }
  }
  CHECK(unequal == 0);
}

void compare_inputs(const TextureInput& a, const TextureInput& b) {
  REQUIRE(bool(a) == bool(b));
  if (!a) return;
  CHECK(a.texture->width == b.texture->width);
  CHECK(a.texture->height == b.texture->height);
  CHECK(a.texture->color_space == b.texture->color_space);
  CHECK(a.texture->bytes == b.texture->bytes);
  CHECK(a.wrap_u == b.wrap_u);
  CHECK(a.wrap_v == b.wrap_v);
  CHECK(a.scale == b.scale);
  CHECK(a.bias == b.bias);
  CHECK(a.uv_from_mesh_uv.isApprox(b.uv_from_mesh_uv, 1e-6f));
}

void compare_materials(const Material& a, const Material& b) {
  INFO(a.name);
  compare_inputs(a.base_color_texture, b.base_color_texture);
  compare_inputs(a.normal_texture, b.normal_texture);
  compare_inputs(a.roughness_texture, b.roughness_texture);
  if (a.transmission == 0) CHECK(a.base_color == b.base_color);
  CHECK(a.metallic == b.metallic);
  if (!a.roughness_texture) CHECK(a.roughness == b.roughness);
  CHECK(a.transmission == b.transmission);
  CHECK(a.is_thin_walled == b.is_thin_walled);
  CHECK(a.opacity == b.opacity);
  CHECK(a.clearcoat == b.clearcoat);
  CHECK(a.ior == b.ior);
  CHECK(a.emission == b.emission);
}

/// The material of each triangle.
const Material& material_of(const Node& node, std::size_t triangle) {
  const auto& slots = node.mesh->material_slots;
  return *node.materials.at(slots.empty() ? 0 : slots[triangle]);
}

void compare(const Scene& a, NodeId root_a, const Scene& b, NodeId root_b) {
  const auto things_a = things(a, root_a), things_b = things(b, root_b);
  CHECK(things_a.size() == things_b.size());
  const Affine a_root = a.world_from_node(root_a), b_root = b.world_from_node(root_b);
  for (const auto& [path, id] : things_a) {
    INFO(path);
    const auto other = things_b.find(path);
    REQUIRE(other != things_b.end());
    const Node& node_a = a[id];
    const Node& node_b = b[other->second];
    const Affine pose_a = a_root.inverse() * a.world_from_node(id);
    const Affine pose_b = b_root.inverse() * b.world_from_node(other->second);
    CHECK((pose_a.matrix() - pose_b.matrix()).cwiseAbs().maxCoeff() < 1e-9);
    REQUIRE(bool(node_a.mesh) == bool(node_b.mesh));
    REQUIRE(node_a.light.has_value() == node_b.light.has_value());
    if (node_a.mesh) {
      compare_meshes(*node_a.mesh, *node_b.mesh);
      std::map<const Material*, const Material*> pairs;
      for (std::size_t t = 0; t < node_a.mesh->triangles.size(); ++t) {
        pairs.emplace(&material_of(node_a, t), &material_of(node_b, t));
      }
      for (const auto& [ours, theirs] : pairs) compare_materials(*ours, *theirs);
    }
    if (node_a.light) {
      CHECK(node_a.light->kind == node_b.light->kind);
      CHECK((node_a.light->color - node_b.light->color).norm() <
            1e-5f * node_a.light->color.norm());
      CHECK(node_a.light->radius_m == Approx(node_b.light->radius_m));
    }
  }
}

std::string slurp(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("an exported room loads as the room that it was", "[export][slow]") {
  Workshop shop;
  Scene scene, loaded;
  const NodeId root = scene.create(scene.root(), "room");
  dining_room::build_dining_room(3, *shop.host, scene, root);
  const NodeId back = shop.there_and_back(scene, root, "export_scene.usdc", loaded);
  compare(scene, root, loaded, back);
  CHECK(shop.warnings.empty());
  // The same bytes a second time.
  const std::string first = slurp(shop.folder / "export_scene.usdc");
  export_scene(scene, root, shop.folder / "again" / "export_scene.usdc", {}, *shop.host);
  CHECK(slurp(shop.folder / "again" / "export_scene.usdc") == first);
}

TEST_CASE("objects keep mass, collider and labels", "[export]") {
  for (const char* file : {"drill.usda", "drill.usd"}) {
    INFO(file);
    Workshop shop;
    Scene scene, loaded;
    const NodeId root = scene.create(scene.root(), "drill");
    samples::SamplesLoader({}, *shop.host).load("sample:035_power_drill", scene, root);
    scene.edit(scene[root].children[0]).labels["class"] = "power_drill";
    const NodeId back = shop.there_and_back(scene, root, file, loaded);
    compare(scene, root, loaded, back);
    int bodies = 0, colliders = 0;
    for (const NodeId id : loaded.subtree(back)) {
      if (loaded[id].rigid_body) {
        ++bodies;
        CHECK(loaded[id].rigid_body->mass_kg == Approx(0.895));
      }
      if (loaded[id].collider) {
        ++colliders;
        CHECK(loaded[id].collider->shape == ColliderShape::ConvexHull);
      }
      if (loaded[id].mesh) CHECK(loaded.effective_labels(id) == Labels{{"class", "power_drill"}});
    }
    CHECK(bodies == 1);
    CHECK(colliders == 1);
    export_scene(scene, root, shop.folder / "plain.usda", {.with_physics = false}, *shop.host);
    CHECK(slurp(shop.folder / "plain.usda").find("physics") == std::string::npos);
  }
}

TEST_CASE("joints come back with their places, limits and positions", "[export]") {
  for (const char* file : {"joints.usda", "joints.usdc"}) {
    INFO(file);
    Workshop shop;
    Scene scene, loaded;
    const NodeId root = scene.create(scene.root(), "thing");
    scene.set_pose(root, Affine(Eigen::Translation3d(5, 6, 7)));
    const auto body = [&](const char* name, const Vec3& place, double angle, double scale) {
      const NodeId id = scene.create(root, name);
      scene.set_pose(id,
                     Transform{place, Quat(Eigen::AngleAxisd(angle, Vec3(1, -1, 2).normalized())),
                               Vec3::Constant(scale)});
      scene.edit(id).rigid_body = RigidBody{};
      scene.edit(id).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(0.1)));
      scene.edit(id).collider = Collider{};
      return id;
    };
    const NodeId base = body("base", {0, 0, 1}, 0.3, 2.0);
    const NodeId door = body("door", {0.3, 0, 1}, -0.4, 1.0);
    const NodeId drawer = body("drawer", {0, 0.4, 1}, 0.0, 0.5);
    const NodeId leg = body("leg", {0, 0, 0.5}, 1.0, 1.0);
    Affine place = Affine(Eigen::Translation3d(0.05, 0.02, -0.1));
    place.linear() = Eigen::AngleAxisd(0.8, Vec3(1, 1, 0).normalized()).toRotationMatrix();
    const auto joint = [&](NodeId above, const char* name, JointKind kind, const Vec3& axis,
                           NodeId parent, NodeId child, double lower, double upper) {
      const NodeId id = scene.create(above, name);
      Joint made;
      made.kind = kind;
      made.axis = axis;
      made.parent_body = parent;
      made.child_body = child ? child : id;
      if (parent == base) made.parent_from_joint = place;
      made.lower = lower;
      made.upper = upper;
      scene.edit(id).joint = made;
      return id;
    };
    const NodeId hinge = joint(root, "hinge", JointKind::Revolute, Vec3(1, 2, 2).normalized(), base,
                               door, -0.5, 1.5);
    const NodeId slide =
        joint(root, "slide", JointKind::Prismatic, -Vec3::UnitY(), base, drawer, -0.1, 0.2);
    joint(root, "weld", JointKind::Fixed, Vec3::UnitX(), door, drawer, -kInfinity, kInfinity);
    const NodeId hip = scene.create(root, "hip");
    const NodeId first =
        joint(hip, "rotX", JointKind::Revolute, Vec3::UnitX(), base, NodeId{}, -0.3, 0.4);
    const NodeId second =
        joint(hip, "rotY", JointKind::Revolute, -Vec3::UnitZ(), first, leg, -0.6, kInfinity);
    const double positions[] = {0.7, 0.15, 0.2, -0.25};
    pose_joints(scene, std::vector<JointTarget>{{hinge, positions[0]},
                                                {slide, positions[1]},
                                                {first, positions[2]},
                                                {second, positions[3]}});
    const NodeId back = shop.there_and_back(scene, root, file, loaded);
    CHECK(shop.warnings.empty());
    CHECK(loaded.contains(back));
    const auto found = [&](const char* name) {
      const auto all = loaded.match(std::string("/**/") + name);
      REQUIRE(all.size() == 1);
      return all.front();
    };
    for (const NodeId held : {door, drawer, leg}) {
      INFO(scene[held].name);
      const Affine was = scene.world_from_node(base).inverse() * scene.world_from_node(held);
      const Affine now = loaded.world_from_node(found("base")).inverse() *
                         loaded.world_from_node(found(scene[held].name.c_str()));
      CHECK(now.isApprox(was, 1e-9));
    }
    const auto check = [&](const char* name, NodeId was, double scale) {
      INFO(name);
      const NodeId now = found(name);
      REQUIRE(loaded[now].joint);
      const Joint& a = *scene[was].joint;
      const Joint& b = *loaded[now].joint;
      CHECK(b.kind == a.kind);
      CHECK(b.lower == Approx(scale * a.lower));
      CHECK(b.upper == Approx(scale * a.upper));
      CHECK(joint_position(loaded, now) == Approx(scale * joint_position(scene, was)).margin(1e-5));
    };
    check("hinge", hinge, 1);
    check("slide", slide, 2);  // In the metres of a body of twice the size.
    CHECK(loaded[found("weld")].joint->kind == JointKind::Fixed);
    REQUIRE(compound_joints(loaded).size() == 1);
    check("hip/rotX", first, 1);
    check("hip/rotY", second, 1);
  }
}

TEST_CASE("lights of every kind, cameras and poses come back", "[export]") {
  Workshop shop;
  Scene scene, loaded;
  const NodeId root = scene.create(scene.root(), "lights");
  const auto add = [&](const char* name, LightKind kind) -> Light& {
    const NodeId id = scene.create(root, name);
    Transform pose{
        {0.5, -1.25, 2}, Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), {1, 1, 1}};
    scene.set_pose(id, pose);
    scene.edit(id).light = Light{};
    scene.edit(id).light->kind = kind;
    scene.edit(id).light->color = Vec3f(100, 40, 10);
    return *scene.edit(id).light;
  };
  add("sphere", LightKind::Sphere).radius_m = 0.03;
  add("disk", LightKind::Disk).radius_m = 0.2;
  Light& rect = add("rect", LightKind::Rect);
  rect.width_m = 0.3;
  rect.height_m = 0.7;
  add("sun", LightKind::Distant).angle_rad = 0.02;
  auto sky = std::make_shared<Texture>();
  sky->width = 4;
  sky->height = 2;
  sky->channels = 3;
  sky->floats.assign(24, 0.5f);
  add("dome", LightKind::Dome).texture = sky;
  const NodeId eye = scene.create(root, "eye");
  scene.edit(eye).camera = Camera::from_lens(640, 480, 18, 24);
  scene.edit(eye).camera->cx = 200;
  scene.edit(eye).camera->cy = 300;

  const NodeId back = shop.there_and_back(scene, root, "lights.usda", loaded);
  compare(scene, root, loaded, back);
  const auto found = things(loaded, back);
  CHECK(loaded[found.at("/rect")].light->width_m == Approx(0.3));
  CHECK(loaded[found.at("/rect")].light->height_m == Approx(0.7));
  CHECK(loaded[found.at("/sun")].light->angle_rad == Approx(0.02));
  REQUIRE(loaded[found.at("/dome")].light->texture);
  CHECK(loaded[found.at("/dome")].light->texture->floats == sky->floats);
  REQUIRE(loaded[found.at("/eye")].camera);
  const Camera& camera = *loaded[found.at("/eye")].camera;
  CHECK(camera.focal_length_mm == Approx(18));
  CHECK(camera.cx / camera.width == Approx(200.0 / 640));
  CHECK(camera.cy / camera.height == Approx(300.0 / 480));
}

TEST_CASE("what several nodes share is in a crate once, and is shared again", "[export]") {
  Workshop shop;
  const auto mesh = std::make_shared<const Mesh>(make_sphere(0.5));
  const auto size_with = [&](int copies, Scene& loaded) {
    Scene scene;
    const NodeId root = scene.create(scene.root(), "row");
    for (int i = 0; i < copies; ++i) {
      const NodeId id = scene.create(root, "ball");
      scene.set_pose(id, Transform{{double(i), 0, 0}, Quat::Identity(), {1, 1, 1}});
      // Equal, or the same.
      scene.edit(id).mesh = i % 2 == 0 ? mesh : std::make_shared<const Mesh>(*mesh);
    }
    const std::string file = std::to_string(copies) + ".usdc";
    shop.there_and_back(scene, root, file.c_str(), loaded);
    return fs::file_size(shop.folder / file);
  };
  Scene one, many;
  const auto alone = size_with(1, one);
  CHECK(size_with(20, many) < alone + alone / 5);
  std::map<const Mesh*, int> users;
  for (const NodeId id : many.subtree(many.root())) {
    if (many[id].mesh) ++users[many[id].mesh.get()];
  }
  REQUIRE(users.size() == 1);
  CHECK(users.begin()->second == 20);
}

TEST_CASE("a sky is written as a picture, other endings are refused", "[export]") {
  Workshop shop;
  Scene scene;
  const NodeId root = scene.create(scene.root(), "box");
  scene.edit(root).mesh = std::make_shared<const Mesh>(make_box({1, 2, 3}));
  CHECK_THROWS_WITH(export_scene(scene, root, shop.folder / "box.obj", {}, *shop.host),
                    ContainsSubstring("expected a file that ends in .usda, .usdc, .usd or .hdr"));
  CHECK_THROWS_WITH(export_scene(scene, root, shop.folder / "box.hdr", {}, *shop.host),
                    ContainsSubstring("the asset has no dome light"));
  std::ofstream(shop.folder / "file") << "x";
  CHECK_THROWS_WITH(export_scene(scene, root, shop.folder / "file" / "box.usda", {}, *shop.host),
                    ContainsSubstring("cannot be written"));

  samples::SamplesLoader({}, *shop.host).load("sky:Evening/evening_road_01_4k", scene, root);
  export_scene(scene, root, shop.folder / "sky.hdr", {}, *shop.host);
  const auto back = shop.host->read_texture(shop.folder / "sky.hdr");
  const auto& made = scene[root].light->texture;
  REQUIRE(back->floats.size() == made->floats.size());
  double error = 0, sum = 0;
  for (std::size_t i = 0; i < made->floats.size(); ++i) {
    error += std::abs(double(back->floats[i]) - double(made->floats[i]));
    sum += double(made->floats[i]);
  }
  CHECK(error < 0.01 * sum);  // RGBE keeps eight bits
}
