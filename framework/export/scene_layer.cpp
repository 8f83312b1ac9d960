// SPDX-License-Identifier: Apache-2.0
#include "framework/export/scene_layer.h"

#include <map>
#include <optional>
#include <set>
#include <utility>

#include "framework/export/joint_export.h"

namespace diorama::usd_export {
namespace {

constexpr const char* kWorld = "World";
constexpr const char* kMaterials = "_materials";

Matrix usd_matrix(const Affine& map) {
  Matrix matrix{};
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      // Rows and columns change places: USD has row vectors.
      matrix[std::size_t(4 * row + column)] = map.matrix()(column, row);
    }
  }
  return matrix;
}

/// Translate, rotate and scale where that is exact, else one matrix.
void add_pose(Prim& prim, const Affine& pose) {
  if (pose.matrix() == Affine::Identity().matrix()) return;
  if (pose.linear() == Mat3::Identity()) {
    const Vec3 t = pose.translation();
    prim.set("xformOp:translate", "double3", Double3{t.x(), t.y(), t.z()});
    prim.set_uniform("xformOpOrder", "token[]", std::vector<Token>{{"xformOp:translate"}});
    return;
  }
  prim.set("xformOp:transform", "matrix4d", usd_matrix(pose));
  prim.set_uniform("xformOpOrder", "token[]", std::vector<Token>{{"xformOp:transform"}});
}

/// A DomeLight_1 whose pole is the stage's up axis, here z, has the middle of the image at -y; ours
/// is at +x.
Affine light_from_usd_dome() {
  Affine turn = Affine::Identity();
  turn.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return turn;
}

const char* approximation(ColliderShape shape) {
  switch (shape) {
    case ColliderShape::TriangleMesh:
      return "none";
    case ColliderShape::BoundingBox:
      return "boundingCube";
    case ColliderShape::BoundingSphere:
      return "boundingSphere";
    case ColliderShape::ConvexHull:
    case ColliderShape::Primitive:
      break;
  }
  return "convexHull";
}

void add_color_and_size(Prim& prim, const Light& light) {
  const float strength = light.color.maxCoeff();
  prim.set("inputs:color", "color3f", strength > 0 ? Vec3f(light.color / strength) : light.color);
  prim.set("inputs:intensity", "float", strength);
  switch (light.kind) {
    case LightKind::Sphere:
    case LightKind::Disk:
      prim.set("inputs:radius", "float", float(light.radius_m));
      break;
    case LightKind::Rect:
      prim.set("inputs:width", "float", float(light.width_m));
      prim.set("inputs:height", "float", float(light.height_m));
      break;
    case LightKind::Distant:
      prim.set("inputs:angle", "float", float(light.angle_rad * 180 / kPi));
      // The intensity is then what falls on a surface that faces the light.
      prim.set("inputs:normalize", "bool", true);
      break;
    case LightKind::Dome:
      break;
  }
  if (light.cone_angle_rad < kPi) {
    prim.api_schemas.push_back("ShapingAPI");
    prim.set("inputs:shaping:cone:angle", "float", float(light.cone_angle_rad * 180 / kPi));
    prim.set("inputs:shaping:cone:softness", "float", float(light.cone_softness));
  }
}

const char* light_type(LightKind kind) {
  switch (kind) {
    case LightKind::Rect:
      return "RectLight";
    case LightKind::Disk:
      return "DiskLight";
    case LightKind::Distant:
      return "DistantLight";
    case LightKind::Dome:
      return "DomeLight_1";
    case LightKind::Sphere:
      break;
  }
  return "SphereLight";
}

void fill_camera(Prim& prim, const Camera& camera) {
  prim.type = "Camera";
  prim.set("focalLength", "float", float(camera.focal_length_mm));
  prim.set("horizontalAperture", "float", float(camera.horizontal_aperture_mm));
  prim.set(
      "verticalAperture", "float",
      float(camera.horizontal_aperture_mm * camera.height / camera.width * camera.fx / camera.fy));
  // Millimetres of film between its middle and the axis; pixels are counted downwards.
  const double film_per_pixel = camera.horizontal_aperture_mm / camera.width;
  const double right = (0.5 * camera.width - camera.cx) * film_per_pixel;
  const double up = (camera.cy - 0.5 * camera.height) * film_per_pixel * camera.fx / camera.fy;
  if (right != 0.0) prim.set("horizontalApertureOffset", "float", float(right));
  if (up != 0.0) prim.set("verticalApertureOffset", "float", float(up));
  prim.set("clippingRange", "float2", Vec2f(float(camera.near_m), float(camera.far_m)));
  prim.set("focusDistance", "float", float(camera.focus_distance_m));
  prim.set("fStop", "float", float(camera.f_stop));
}

class Exporter {
 public:
  Exporter(const Scene& scene, const std::string& stem, bool with_physics)
      : scene_(scene), with_physics_(with_physics), textures_("textures", stem) {
    materials_.name = kMaterials;
    materials_.type = "Scope";
  }

  SceneLayer run(NodeId root) {
    Prim world = node_prim(root, kWorld, "/" + std::string(kWorld));
    if (with_physics_) add_joints(scene_, paths_, world);
    world.kind = "component";
    if (!materials_.children.empty()) world.children.push_back(std::move(materials_));
    SceneLayer result;
    result.layer.roots.push_back(std::move(world));
    result.textures = textures_.files();
    return result;
  }

 private:
  /// A name that no sibling has.
  static std::string free_name(const std::string& wish, std::set<std::string>& taken) {
    std::string name = prim_name(wish);
    for (int i = 1; !taken.insert(name).second; ++i)
      name = prim_name(wish) + "_" + std::to_string(i);
    return name;
  }

  /// A leaf with nothing but a mesh, light or camera is one prim; others are groups with such
  /// leaves.
  Prim node_prim(NodeId id, const std::string& name, const std::string& path) {
    const Node& node = scene_[id];
    const int things = int(bool(node.mesh)) + int(bool(node.light)) + int(bool(node.camera));
    const bool is_leaf = node.children.empty() && things == 1 && path.rfind('/') != 0;
    paths_.emplace(id, path);
    Prim prim;
    prim.name = name;
    prim.type = "Xform";
    std::set<std::string> taken{kMaterials};
    Affine pose = node.parent_from_node;
    if (is_leaf) {
      fill_thing(prim, node, path, pose);
    } else {
      if (node.mesh) add_thing(prim, id, path, "mesh", taken, &Exporter::fill_mesh);
      if (node.light) add_light(prim, node, path, taken);
      if (node.camera) {
        Prim camera;
        camera.name = free_name("camera", taken);
        fill_camera(camera, *node.camera);
        prim.children.push_back(std::move(camera));
      }
    }
    add_pose(prim, pose);
    if (!node.is_visible) prim.set("visibility", "token", Token{"invisible"});
    add_labels(prim, node);
    if (with_physics_ && node.rigid_body) add_body(prim, *node.rigid_body);
    for (const NodeId child : node.children) {
      const std::string child_name = free_name(scene_[child].name, taken);
      prim.children.push_back(node_prim(child, child_name, path + "/" + child_name));
    }
    return prim;
  }

  void fill_thing(Prim& prim, const Node& node, const std::string& path, Affine& pose) {
    if (node.mesh) return fill_mesh(prim, node, path);
    if (node.camera) return fill_camera(prim, *node.camera);
    if (node.light->kind == LightKind::Dome) pose = pose * light_from_usd_dome();
    fill_light(prim, *node.light);
  }
  void add_thing(Prim& parent, NodeId id, const std::string& path, const char* wish,
                 std::set<std::string>& taken,
                 void (Exporter::*fill)(Prim&, const Node&, const std::string&)) {
    Prim child;
    child.name = free_name(wish, taken);
    (this->*fill)(child, scene_[id], path + "/" + child.name);
    parent.children.push_back(std::move(child));
  }
  void add_light(Prim& parent, const Node& node, const std::string&, std::set<std::string>& taken) {
    Prim child;
    child.name = free_name("light", taken);
    fill_light(child, *node.light);
    if (node.light->kind == LightKind::Dome) add_pose(child, light_from_usd_dome());
    parent.children.push_back(std::move(child));
  }

  void fill_light(Prim& prim, const Light& light) {
    prim.type = light_type(light.kind);
    add_color_and_size(prim, light);
    if (!light.texture) return;
    prim.set("inputs:texture:file", "asset", textures_.name(light.texture, prim.name, "SKY"));
    prim.set("inputs:texture:format", "token", Token{"latlong"});
  }

  void fill_mesh(Prim& prim, const Node& node, const std::string& path) {
    const Mesh& mesh = *node.mesh;
    prim.type = "Mesh";
    prim.api_schemas.push_back("MaterialBindingAPI");
    if (mesh.is_double_sided) prim.set_uniform("doubleSided", "bool", true);
    const Aabb box = mesh.bounds();
    if (!box.is_empty()) {
      prim.set("extent", "float3[]",
               std::vector<Vec3f>{box.min.cast<float>(), box.max.cast<float>()});
    }
    std::vector<int> corners;
    corners.reserve(3 * mesh.triangles.size());
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t corner : triangle) corners.push_back(int(corner));
    }
    prim.set("faceVertexCounts", "int[]", std::vector<int>(mesh.triangles.size(), 3));
    prim.set("faceVertexIndices", "int[]", std::move(corners));
    prim.set("points", "point3f[]", mesh.positions);
    const auto add_primvar = [&](const char* name, const char* type, Value list) {
      prim.set(name, type, std::move(list));
      prim.properties.back().interpolation = "vertex";
    };
    if (!mesh.normals.empty()) add_primvar("normals", "normal3f[]", mesh.normals);
    if (!mesh.uvs.empty()) add_primvar("primvars:st", "texCoord2f[]", mesh.uvs);
    if (!mesh.colors.empty()) add_primvar("primvars:displayColor", "color3f[]", mesh.colors);
    prim.set_uniform("subdivisionScheme", "token", Token{"none"});
    if (with_physics_ && node.collider) add_collider(prim, *node.collider);
    bind_materials(prim, node, path);
  }

  void bind_materials(Prim& prim, const Node& node, const std::string& path) {
    (void)path;
    const Mesh& mesh = *node.mesh;
    if (!node.materials.empty() && node.materials[0]) {
      prim.relate("material:binding", material_path(node.materials[0]));
    }
    if (mesh.material_slots.empty()) return;
    prim.set_uniform("subsetFamily:materialBind:familyType", "token", Token{"nonOverlapping"});
    std::map<std::uint16_t, std::vector<int>> faces;
    for (std::size_t i = 0; i < mesh.material_slots.size(); ++i) {
      faces[mesh.material_slots[i]].push_back(int(i));
    }
    std::set<std::string> taken;
    for (auto& [slot, indices] : faces) {
      if (slot >= node.materials.size() || !node.materials[slot]) continue;
      Prim subset;
      subset.name = free_name(node.materials[slot]->name, taken);
      subset.type = "GeomSubset";
      subset.api_schemas.push_back("MaterialBindingAPI");
      subset.set_uniform("elementType", "token", Token{"face"});
      subset.set_uniform("familyName", "token", Token{"materialBind"});
      subset.set("indices", "int[]", std::move(indices));
      subset.relate("material:binding", material_path(node.materials[slot]));
      prim.children.push_back(std::move(subset));
    }
  }

  std::string material_path(const std::shared_ptr<const Material>& material) {
    const std::string folder = "/" + std::string(kWorld) + "/" + kMaterials + "/";
    if (const auto known = material_names_.find(material.get()); known != material_names_.end()) {
      return folder + known->second;
    }
    const std::string name =
        free_name(material->name.empty() ? "material" : material->name, taken_materials_);
    material_names_.emplace(material.get(), name);
    materials_.children.push_back(material_prim(*material, name, folder + name, textures_));
    return folder + name;
  }

  static void add_labels(Prim& prim, const Node& node) {
    for (const auto& [taxonomy, label] : node.labels) {
      prim.api_schemas.push_back("SemanticsLabelsAPI:" + taxonomy);
      prim.set("semantics:labels:" + taxonomy, "token[]", std::vector<Token>{{label}});
    }
  }
  static void add_collider(Prim& prim, const Collider& collider) {
    prim.api_schemas.insert(prim.api_schemas.end(),
                            {"PhysicsCollisionAPI", "PhysicsMeshCollisionAPI"});
    prim.set("physics:collisionEnabled", "bool", true);
    prim.set_uniform("physics:approximation", "token", Token{approximation(collider.shape)});
  }
  static void add_body(Prim& prim, const RigidBody& body) {
    prim.api_schemas.insert(prim.api_schemas.end(), {"PhysicsRigidBodyAPI", "PhysicsMassAPI"});
    prim.set("physics:rigidBodyEnabled", "bool", true);
    prim.set("physics:mass", "float", float(body.mass_kg));
    if (body.has_gravity) return;
    prim.api_schemas.push_back("PhysxRigidBodyAPI");
    prim.set("physxRigidBody:disableGravity", "bool", true);
  }

  const Scene& scene_;
  bool with_physics_;
  std::map<NodeId, std::string> paths_;
  TextureNames textures_;
  Prim materials_;
  std::map<const Material*, std::string> material_names_;
  std::set<std::string> taken_materials_;
};

}  // namespace

SceneLayer scene_layer(const Scene& scene, NodeId root, const std::string& stem,
                       bool with_physics) {
  return Exporter(scene, stem, with_physics).run(root);
}

}  // namespace diorama::usd_export
