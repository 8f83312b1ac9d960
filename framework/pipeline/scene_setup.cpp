// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/scene_setup.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <set>
#include <string_view>

#include "diorama/error.h"
#include "diorama/geometry.h"
#include "framework/config/clean_text.h"
#include "framework/host/node_content.h"
#include "framework/pipeline/camera_rig.h"
#include "framework/pipeline/keypoints.h"
#include "framework/pipeline/lamps.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

/// Whether the rest of the path goes on with the text, whose '*' stand for anything within a name.
bool starts_with_text(std::string_view path, std::string_view text) {
  const std::size_t star = std::min(text.find('*'), text.size());
  if (path.substr(0, star) != text.substr(0, star)) return false;
  if (star == text.size()) return true;
  path.remove_prefix(star);
  text.remove_prefix(star + 1);
  for (;; path.remove_prefix(1)) {
    if (starts_with_text(path, text)) return true;
    if (path.empty() || path.front() == '/') return false;
  }
}

bool holds_any(std::string_view path, const std::vector<std::string>& texts) {
  return std::any_of(texts.begin(), texts.end(),
                     [&](const std::string& text) { return holds_text(path, text); });
}

std::optional<ColliderShape> collider_shape(std::string_view word) {
  if (word == "triangle_mesh") return ColliderShape::TriangleMesh;
  if (word == "convex_hull") return ColliderShape::ConvexHull;
  if (word == "bounding_box") return ColliderShape::BoundingBox;
  if (word == "bounding_sphere") return ColliderShape::BoundingSphere;
  return std::nullopt;
}

/// Keeps friction and restitution of a collider that the asset brought along.
void set_collider(Scene& scene, NodeId node, ColliderShape shape) {
  Node& edited = scene.edit(node);
  if (!edited.collider) edited.collider.emplace();
  edited.collider->shape = shape;
}

bool claims_scheme(const Loader& loader, std::string_view asset) {
  const std::size_t colon = asset.find(':');
  if (colon == std::string_view::npos) return false;
  const std::string scheme(asset.substr(0, colon + 1));
  const std::vector<std::string> claims = loader.claims();
  return std::find(claims.begin(), claims.end(), scheme) != claims.end();
}

/// Two opposite sides of a mesh's box, in cells, and which of these the mesh reaches.
class BoxSides {
 public:
  /// `gap`: how far below a side counts as reached, in the space of the mesh.
  BoxSides(const Aabb& box, int axis, double gap)
      : box_(box),
        axis_(axis),
        right_((axis + 1) % 3),
        up_((axis + 2) % 3),
        gap_(gap),
        cell_(box.size() / kCells),
        reached_{Cells(kCells * kCells, is_flat()), Cells(kCells * kCells, is_flat())} {}

  void add(const std::array<Vec3, 3>& p) {
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (area == 0.0 || is_flat()) return;
    const auto [left, last] = cells_of(right_, p);
    const auto [bottom, top] = cells_of(up_, p);
    for (int row = bottom; row <= top; ++row) {
      for (int column = left; column <= last; ++column) {
        Vec3 middle = box_.min;
        middle[right_] += (column + 0.5) * cell_[right_];
        middle[up_] += (row + 0.5) * cell_[up_];
        const Vec3 weight(cross(p[1] - middle, p[2] - middle), cross(p[2] - middle, p[0] - middle),
                          cross(p[0] - middle, p[1] - middle));
        if ((weight / area).minCoeff() < 0.0) continue;
        const double place = (weight / area).dot(Vec3(p[0][axis_], p[1][axis_], p[2][axis_]));
        const auto cell = std::size_t(row * kCells + column);
        if (place - box_.min[axis_] <= gap_) reached_[0][cell] = true;
        if (box_.max[axis_] - place <= gap_) reached_[1][cell] = true;
      }
    }
  }

  bool are_reached() const {
    constexpr double kMostEmpty = 0.02;  // of a side's cells: bevelled edges
    return std::ranges::all_of(reached_, [](const Cells& side) {
      return double(std::ranges::count(side, false)) <= kMostEmpty * kCells * kCells;
    });
  }

 private:
  using Cells = std::vector<bool>;
  static constexpr int kCells = 24;  // across and down

  /// Nothing is below a side without area.
  bool is_flat() const { return cell_[right_] <= 0.0 || cell_[up_] <= 0.0; }
  double cross(const Vec3& a, const Vec3& b) const {
    return a[right_] * b[up_] - b[right_] * a[up_];
  }
  /// First and last of the cells whose middles lie within the triangle's extent.
  std::pair<int, int> cells_of(int along, const std::array<Vec3, 3>& p) const {
    const auto [low, high] = std::minmax({p[0][along], p[1][along], p[2][along]});
    const auto place = [&](double value) {
      return std::clamp((value - box_.min[along]) / cell_[along] - 0.5, -1.0, double(kCells));
    };
    return {std::max(int(std::ceil(place(low))), 0),
            std::min(int(std::floor(place(high))), kCells - 1)};
  }

  Aabb box_;
  int axis_, right_, up_;
  double gap_;
  Vec3 cell_;
  std::array<Cells, 2> reached_;  ///< The low side and the high one.
};

/// Whether a mesh reaches all six sides of its box, as a table top does: else its box is solid
/// where pictures show nothing, under a table that is one mesh or round a round one.
bool fills_box(const Mesh& mesh, const Affine& world_from_node) {
  constexpr double kGap = 0.01;  // metres
  const Aabb box = mesh.bounds();
  if (box.is_empty()) return true;
  for (int axis = 0; axis < 3; ++axis) {
    BoxSides sides(box, axis, kGap / std::max(world_from_node.linear().col(axis).norm(), 1e-12));
    for (const auto& indices : mesh.triangles) {
      std::array<Vec3, 3> corners;
      for (std::size_t i = 0; i < 3; ++i) corners[i] = mesh.positions[indices[i]].cast<double>();
      sides.add(corners);
    }
    if (!sides.are_reached()) return false;
  }
  return true;
}

/// Parts of paths below one node, in traversal order.
class PathsBelow {
 public:
  PathsBelow(const Scene& scene, NodeId top) {
    const std::size_t prefix = scene.path(top).size();
    for (const NodeId node : scene.subtree(top)) {
      if (node != top) paths_.emplace_back(node, scene.path(node).substr(prefix));
    }
  }
  const std::vector<std::pair<NodeId, std::string>>& all() const { return paths_; }
  NodeId first_with(std::string_view text) const {
    for (const auto& [node, path] : paths_) {
      if (holds_text(path, text)) return node;
    }
    return {};
  }

 private:
  std::vector<std::pair<NodeId, std::string>> paths_;
};

NodeId node_at(Scene& scene, std::string_view path) {
  NodeId node = scene.root();
  std::size_t start = 1;
  while (start <= path.size()) {
    const std::size_t end = std::min(path.find('/', start), path.size());
    const NodeId known = scene.find(path.substr(0, end));
    node = known ? known : scene.create(node, path.substr(start, end - start));
    start = end + 1;
  }
  return node;
}

/// What the joints below some nodes move, as far as it is a body of its own. What they fix to where
/// they begin is none.
std::set<NodeId> jointed_bodies(const Scene& scene, const std::vector<NodeId>& nodes) {
  std::set<NodeId> moved;
  std::multimap<NodeId, NodeId> fixed;  // by parent
  for (const NodeId node : nodes) {
    const auto& joint = scene[node].joint;
    if (!joint) continue;
    moved.insert(joint->child_body);
    if (joint->kind == JointKind::Fixed) fixed.emplace(joint->parent_body, joint->child_body);
  }
  std::vector<NodeId> still;
  for (const auto& [parent, child] : fixed) {
    if (!moved.contains(parent)) still.push_back(parent);
  }
  while (!still.empty()) {
    const auto [first, last] = fixed.equal_range(still.back());
    still.pop_back();
    for (auto held = first; held != last; ++held) {
      if (moved.erase(held->second) > 0) still.push_back(held->second);
    }
  }
  std::erase_if(moved, [&](NodeId body) { return !scene[body].rigid_body; });
  return moved;
}

/// The object moves as one: bodies inside an asset become part of it, but for those to keep.
/// Returns their mass, if any.
std::optional<double> take_over_bodies(Scene& scene, const std::vector<NodeId>& nodes,
                                       const std::set<NodeId>& kept) {
  std::optional<double> mass_kg;
  for (const NodeId node : nodes) {
    if (!scene[node].rigid_body || kept.contains(node)) continue;
    mass_kg = mass_kg.value_or(0.0) + scene[node].rigid_body->mass_kg;
    scene.edit(node).rigid_body.reset();
  }
  return mass_kg && *mass_kg > 0.0 ? mass_kg : std::nullopt;
}

void make_physical(Scene& scene, NodeId object, const ObjectGroup& group, bool floats) {
  const std::vector<NodeId> nodes = scene.subtree(object);
  std::set<NodeId> kept;
  if (group.joints == "free") kept = jointed_bodies(scene, nodes);
  for (const NodeId part : kept) scene.edit(part).rigid_body->has_gravity = !floats;
  const std::optional<double> mass_kg = take_over_bodies(scene, nodes, kept);
  const std::optional<ColliderShape> shape = collider_shape(group.collider);
  for (const NodeId node : nodes) {
    if (!scene[node].mesh) continue;
    if (!shape) {
      scene.edit(node).collider.reset();
      continue;
    }
    const auto& collider = scene[node].collider;
    const bool is_exact = collider && collider->primitive != PrimitiveShape::None;
    if (!is_exact) set_collider(scene, node, *shape);
  }
  RigidBody body;
  body.mass_kg = mass_kg.value_or(group.mass_kg);
  body.has_gravity = !floats;
  scene.edit(object).rigid_body = body;
}

void label_parts(Scene& scene, NodeId object, const ObjectGroup& group) {
  for (const auto& [pattern, label] : group.part_labels) {
    for (const NodeId part : scene.match(scene.path(object) + "/**/" + pattern)) {
      if (scene[part].joint || !scene[part].labels.empty()) continue;
      scene.edit(part).labels.emplace(group.taxonomy, label);
    }
  }
}

NodeId spawn(const PlannedObject& planned, const ObjectGroup& group, Scene& scene, Host& host) {
  const NodeId object = scene.create(node_at(scene, group.under), planned.name);
  if (scene.path(object) != planned.path) {
    throw Error(ErrorKind::Internal, "object " + planned.path + " became " + scene.path(object));
  }
  const NodeId root = host.load_asset(planned.asset, scene, object);
  keep_keypoints(scene, object, root, planned.asset, group.keypoints);
  for (const NodeId node : scene.subtree(object)) {
    if (!scene[node].labels.empty()) scene.edit(node).labels.clear();
  }
  scene.edit(object).labels = planned.labels;
  label_parts(scene, object, group);
  make_physical(scene, object, group, planned.floats);
  return object;
}

LightKind light_kind(std::string_view word) {
  if (word == "rect") return LightKind::Rect;
  if (word == "disk") return LightKind::Disk;
  if (word == "distant") return LightKind::Distant;
  if (word == "dome") return LightKind::Dome;
  return LightKind::Sphere;
}

double radians(double degrees) { return degrees * kPi / 180.0; }

Light light_of(const LightGroup& group, Host& host) {
  Light light;
  light.kind = light_kind(group.type);
  light.color = (group.color * group.intensity).cast<float>();
  light.radius_m = group.radius_m;
  light.width_m = group.width_m;
  light.height_m = group.height_m;
  light.angle_rad = radians(group.angle_deg);
  light.cone_angle_rad = radians(group.cone_angle_deg);
  light.cone_softness = group.cone_softness;
  light.is_visible_to_camera = group.visible_to_camera;
  if (group.texture) light.texture = host.read_texture(host.resolve(*group.texture));
  return light;
}

/// Hidden boxes round the inside of a box, so that nothing leaves it.
void build_walls(const Vec3& size, const Vec3& centre_world, Scene& scene) {
  constexpr double kThicknessM = 0.5;
  constexpr const char* kNames[3][2] = {{"left", "right"}, {"back", "front"}, {"floor", "ceiling"}};
  const NodeId parent = node_at(scene, "/Walls");
  scene.edit(parent).is_visible = false;
  for (int axis = 0; axis < 3; ++axis) {
    // The corners as well: walls of later axes reach over those of earlier ones.
    Vec3 wall_size = size;
    for (int before = 0; before < axis; ++before) wall_size[before] += 2.0 * kThicknessM;
    wall_size[axis] = kThicknessM;
    const auto mesh = std::make_shared<const Mesh>(make_box(wall_size));
    for (int side = 0; side < 2; ++side) {
      const NodeId wall = scene.create(parent, kNames[axis][side]);
      Vec3 place = centre_world;
      place[axis] += (side == 0 ? -0.5 : 0.5) * (size[axis] + kThicknessM);
      scene.set_pose(wall, Transform{place});
      Collider collider;
      collider.shape = ColliderShape::Primitive;
      collider.primitive = PrimitiveShape::Box;
      collider.primitive_size = wall_size;
      scene.edit(wall).mesh = mesh;
      scene.edit(wall).collider = collider;
    }
  }
}

void dim_environment(double most_lux, NodeId environment, Scene& scene, Host& host) {
  const DimmedLamps dimmed = dim_lamps(scene, environment, most_lux);
  if (dimmed.count == 0) return;
  char text[160];
  std::snprintf(text, sizeof text,
                ": %zu lamps dimmed to %.4g lux 2 m away, the brightest from %.4g lux",
                dimmed.count, most_lux, dimmed.brightest_lux);
  host.log(LogLevel::Info, scene.path(environment) + text);
}

Quat rotation_xyz(const Vec3& degrees) {
  return Quat(Eigen::AngleAxisd(radians(degrees.z()), Vec3::UnitZ()) *
              Eigen::AngleAxisd(radians(degrees.y()), Vec3::UnitY()) *
              Eigen::AngleAxisd(radians(degrees.x()), Vec3::UnitX()));
}

}  // namespace

bool holds_text(std::string_view path, std::string_view text) {
  for (std::size_t start = 0; start <= path.size(); ++start) {
    if (starts_with_text(path.substr(start), text)) return true;
  }
  return false;
}

NodeId load_environment(const std::string& asset, const ComponentConfig& entry, Loader& loader,
                        Scene& scene, Host& host) {
  const NodeId parent = node_at(scene, "/Environment");
  if (!claims_scheme(loader, asset)) return host.load_asset(asset, scene, parent);
  const NodeId environment = scene.create(parent, node_name(asset_stem(asset)));
  call_component("loader '" + entry.type + "'", [&] { loader.load(asset, scene, environment); });
  if (const std::string word = first_unclean_word(scene, environment); !word.empty()) {
    throw Error(ErrorKind::Plugin, "loader '" + entry.type + "': " + asset + ": the name '" +
                                       clean_name(word) +
                                       "' is no UTF-8 text without control characters");
  }
  return environment;
}

std::vector<NodeId> nodes_to_hide(const std::vector<std::string>& texts, NodeId environment,
                                  const Scene& scene) {
  const PathsBelow paths(scene, environment);
  std::vector<NodeId> nodes;
  for (const auto& [node, path] : paths.all()) {
    if (scene[node].is_visible && holds_any(path, texts)) nodes.push_back(node);
  }
  return nodes;
}

Vec3 apply_environment_rules(const EnvironmentRules& rules, bool debug, NodeId environment,
                             Scene& scene, Host& host) {
  const PathsBelow paths(scene, environment);
  const auto hide = [&](const std::vector<std::string>& texts) {
    for (const NodeId node : nodes_to_hide(texts, environment, scene)) {
      scene.edit(node).is_visible = false;
    }
  };
  hide(rules.hide);
  if (debug) hide(rules.hide_in_debug);
  const auto box_is_full = [&](NodeId node) {
    return fills_box(*scene[node].mesh, scene.world_from_node(node));
  };
  if (const auto shape = collider_shape(rules.colliders)) {
    int half_empty = 0;
    for (const NodeId node : scene.subtree(environment)) {
      if (!scene[node].mesh) continue;
      set_collider(scene, node, *shape);
      if (*shape == ColliderShape::BoundingBox && !box_is_full(node)) ++half_empty;
    }
    if (half_empty > 0) {
      host.log(LogLevel::Warning, scene.path(environment) +
                                      ": 'environment.colliders: bounding_box' makes " +
                                      std::to_string(half_empty) +
                                      " meshes solid where pictures show nothing: things will lie "
                                      "on air, and lean on it");
    }
  }
  if (rules.joints == "held") {
    const std::vector<NodeId> nodes = scene.subtree(environment);
    for (const NodeId node : nodes) {
      if (!scene[node].joint) continue;
      for (const NodeId body : {scene[node].joint->parent_body, scene[node].joint->child_body}) {
        if (scene[body].rigid_body) scene.edit(body).rigid_body.reset();
      }
    }
  }
  for (const std::string& text : rules.box_colliders) {
    const NodeId match = paths.first_with(text);
    if (!match) continue;
    for (const NodeId node : scene.subtree(match)) {
      if (scene[node].mesh && box_is_full(node)) {
        set_collider(scene, node, ColliderShape::BoundingBox);
      }
    }
  }
  if (rules.max_lamp_lux) dim_environment(*rules.max_lamp_lux, environment, scene, host);
  Vec3 working_area_world = Vec3::Zero();
  if (rules.working_area) {
    if (const NodeId match = paths.first_with(*rules.working_area)) {
      working_area_world = scene.world_from_node(match).translation();
    }
  }
  if (rules.walls.size() == 3) {
    build_walls({rules.walls[0], rules.walls[1], rules.walls[2]}, working_area_world, scene);
  }
  return working_area_world;
}

std::vector<NodeId> spawn_objects(const std::vector<PlannedObject>& objects, const Job& job,
                                  Scene& scene, Host& host) {
  for (const ObjectGroup& group : job.objects) node_at(scene, group.under);
  std::vector<NodeId> nodes;
  nodes.reserve(objects.size());
  for (const PlannedObject& object : objects) {
    nodes.push_back(spawn(object, job.objects[object.group], scene, host));
  }
  return nodes;
}

void create_lights(const std::vector<LightGroup>& groups, Scene& scene, Host& host) {
  const NodeId parent = node_at(scene, "/Lights");
  for (const LightGroup& group : groups) {
    if (group.count == 0) continue;
    const Light light = light_of(group, host);
    for (int i = 0; i < group.count; ++i) {
      const NodeId node = scene.create(parent, group.name + "_" + std::to_string(i));
      scene.edit(node).light = light;
      scene.set_pose(node, Transform{group.position, rotation_xyz(group.rotation_deg)});
    }
  }
}

std::vector<NodeId> create_cameras(const std::vector<CameraGroup>& groups, Scene& scene) {
  const NodeId parent = node_at(scene, "/Cameras");
  std::vector<NodeId> nodes;
  for (const CameraGroup& group : groups) {
    const Transform place{group.position, look_rotation(group.look_at - group.position)};
    NodeId rig;
    for (const PlannedCamera& planned : planned_cameras(group)) {
      const bool is_alone = planned.rig.empty();
      if (!is_alone && (!rig || scene[rig].name != planned.rig)) {
        rig = scene.create(parent, planned.rig);
        scene.set_pose(rig, place);
      }
      const NodeId node = scene.create(is_alone ? parent : rig, planned.name);
      scene.edit(node).camera = planned.camera;
      if (is_alone) {
        scene.set_pose(node, place);
      } else {
        scene.set_pose(node, planned.rig_from_camera);
      }
      nodes.push_back(node);
    }
  }
  return nodes;
}

std::vector<NodeId> create_camera_spheres(const std::vector<NodeId>& cameras, double radius_m,
                                          Scene& scene) {
  std::vector<NodeId> spheres;
  for (const NodeId camera : cameras) {
    const NodeId sphere = scene.create(camera, "Sphere");
    Collider collider;
    collider.shape = ColliderShape::Primitive;
    collider.primitive = PrimitiveShape::Sphere;
    collider.primitive_size = Vec3::Constant(2.0 * radius_m);
    scene.edit(sphere).collider = collider;
    spheres.push_back(sphere);
  }
  return spheres;
}

NodeId create_overview_camera(const Vec3& working_area_world, Scene& scene) {
  constexpr double kHeightM = 10.0;
  constexpr int kPixels = 768;
  const NodeId node = scene.create(scene.root(), "OverviewCamera");
  scene.edit(node).camera = Camera::from_lens(kPixels, kPixels, 24.0, 20.955);
  scene.set_pose(node, Transform{working_area_world + kHeightM * Vec3::UnitZ(),
                                 look_rotation(-Vec3::UnitZ())});
  return node;
}

}  // namespace diorama
