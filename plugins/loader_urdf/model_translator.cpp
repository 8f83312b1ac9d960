// SPDX-License-Identifier: Apache-2.0
#include "loader_urdf/model_translator.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <deque>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "diorama/error.h"

namespace diorama::loader_urdf {
namespace {

constexpr std::size_t kMaxWarnings = 20;
/// Of a link without a shape and a mass of its own. Lighter ones strain joints between heavy ones.
constexpr double kLightBody = 0.1;  // kg

bool has_collision(const urdf::Link& link) {
  return std::ranges::any_of(link.collision_array,
                             [](const auto& shape) { return shape && shape->geometry; });
}

std::string node_name(const std::string& name, const char* fallback) {
  std::string result = name.empty() ? fallback : name.substr(0, 200);
  std::replace(result.begin(), result.end(), '/', '_');
  return result;
}

Vec3 to_vec3(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

bool is_length(double number) { return number > 0.0 && number < 1e6; }

PrimitiveShape primitive_of(const urdf::Geometry& geometry) {
  if (geometry.type == urdf::Geometry::BOX) return PrimitiveShape::Box;
  if (geometry.type == urdf::Geometry::SPHERE) return PrimitiveShape::Sphere;
  if (geometry.type == urdf::Geometry::CYLINDER) return PrimitiveShape::Cylinder;
  return PrimitiveShape::None;
}

/// Nothing for a shape without a size.
std::optional<Mesh> mesh_of(const urdf::Geometry& geometry) {
  if (geometry.type == urdf::Geometry::BOX) {
    const Vec3 size = to_vec3(static_cast<const urdf::Box&>(geometry).dim);
    if (!is_length(size.x()) || !is_length(size.y()) || !is_length(size.z())) return std::nullopt;
    return make_box(size);
  }
  if (geometry.type == urdf::Geometry::SPHERE) {
    const double radius = static_cast<const urdf::Sphere&>(geometry).radius;
    if (!is_length(radius)) return std::nullopt;
    return make_sphere(radius);
  }
  if (geometry.type == urdf::Geometry::CYLINDER) {
    const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
    if (!is_length(cylinder.radius) || !is_length(cylinder.length)) return std::nullopt;
    return make_cylinder(cylinder.radius, cylinder.length);
  }
  return std::nullopt;
}

bool are_equal(const urdf::Pose& a, const urdf::Pose& b) {
  return a.position.x == b.position.x && a.position.y == b.position.y &&
         a.position.z == b.position.z && a.rotation.x == b.rotation.x &&
         a.rotation.y == b.rotation.y && a.rotation.z == b.rotation.z &&
         a.rotation.w == b.rotation.w;
}

bool are_equal(const urdf::Geometry& a, const urdf::Geometry& b) {
  if (a.type != b.type) return false;
  if (a.type == urdf::Geometry::BOX) {
    return to_vec3(static_cast<const urdf::Box&>(a).dim) ==
           to_vec3(static_cast<const urdf::Box&>(b).dim);
  }
  if (a.type == urdf::Geometry::SPHERE) {
    return static_cast<const urdf::Sphere&>(a).radius == static_cast<const urdf::Sphere&>(b).radius;
  }
  if (a.type == urdf::Geometry::CYLINDER) {
    const auto& one = static_cast<const urdf::Cylinder&>(a);
    const auto& other = static_cast<const urdf::Cylinder&>(b);
    return one.radius == other.radius && one.length == other.length;
  }
  const auto& one = static_cast<const urdf::Mesh&>(a);
  const auto& other = static_cast<const urdf::Mesh&>(b);
  return one.filename == other.filename && to_vec3(one.scale) == to_vec3(other.scale);
}

/// Models do not hold models: they might hold themselves. Loaders ask for no case, and variants may
/// follow a name.
bool is_model(const std::filesystem::path& file) {
  std::string name = file.filename().string();
  for (char& c : name) c = char(std::tolower(static_cast<unsigned char>(c)));
  return name.find(".urdf") != std::string::npos;
}

float linear_of_srgb(float value) {
  const float clamped = std::isfinite(value) ? std::clamp(value, 0.0f, 1.0f) : 0.5f;
  return clamped <= 0.04045f ? clamped / 12.92f : std::pow((clamped + 0.055f) / 1.055f, 2.4f);
}

}  // namespace

void ModelTranslator::warn(const std::string& text) {
  if (warnings_.size() < kMaxWarnings) warnings_.push_back(text);
}

Affine ModelTranslator::pose_of(const urdf::Pose& pose, const std::string& where) {
  const Vec3 place(pose.position.x, pose.position.y, pose.position.z);
  const Quat turn(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  Affine result = Affine::Identity();
  if (!place.allFinite() || !turn.coeffs().allFinite() || turn.norm() < 1e-9) {
    warn(where + " has an origin that is no number; it counts as zero");
    return result;
  }
  result.translation() = place;
  result.linear() = turn.normalized().toRotationMatrix();
  return result;
}

void ModelTranslator::translate(NodeId root) {
  // Links in the order of the tree, each once, whatever joints say; then what holds them together.
  std::vector<PlacedLink> order;
  std::vector<const urdf::Joint*> joints;
  std::set<std::string> seen;
  std::deque<PlacedLink> waiting{{model_.root_link_.get(), Affine::Identity()}};
  while (!waiting.empty()) {
    const PlacedLink placed = waiting.front();
    waiting.pop_front();
    if (!seen.insert(placed.link->name).second) continue;
    order.push_back(placed);
    for (const auto& joint : placed.link->child_joints) {
      const auto child = model_.links_.find(joint->child_link_name);
      if (child == model_.links_.end()) continue;
      joints.push_back(joint.get());
      const Affine link_from_joint =
          pose_of(joint->parent_to_joint_origin_transform, "joint '" + joint->name + "'");
      waiting.push_back({child->second.get(), placed.root_from_link * link_from_joint});
    }
  }
  add_links(order, joints, root);
  for (const auto& [name, link] : model_.links_) {
    if (!links_.contains(name)) {
      warn("link '" + name + "' hangs on a loop of joints, not on the root; it is left out");
    }
  }
  if (joints.empty()) return;
  const NodeId above = scene_.create(root, "joints");
  for (const urdf::Joint* joint : joints) add_joint(*joint, above);
  for (const urdf::Joint* joint : joints) {
    const auto node = joints_.find(joint->name);
    if (!joint->mimic || node == joints_.end()) continue;
    const auto leader = joints_.find(joint->mimic->joint_name);
    const bool is_sound = leader != joints_.end() && leader != node &&
                          std::isfinite(joint->mimic->multiplier) &&
                          std::isfinite(joint->mimic->offset);
    if (!is_sound) {
      warn("joint '" + joint->name + "' mimics no joint of the model; it moves freely");
      continue;
    }
    scene_.edit(node->second).joint->mimic =
        Joint::Mimic{leader->second, joint->mimic->multiplier, joint->mimic->offset};
  }
}

/// Links that nothing can touch are no bodies, and would stay where they are while bodies move:
/// what is fixed to a body lies below it, and what moves between bodies is a light one.
void ModelTranslator::add_links(const std::vector<PlacedLink>& order,
                                const std::vector<const urdf::Joint*>& joints, NodeId root) {
  std::map<std::string, std::string> carriers;  // of each link that is or rides on a body
  // By convention, what is called "world" stands still, and so does what is fixed to it.
  const auto is_world = [&](const std::string& link) {
    return link == "world" && link == model_.root_link_->name && !has_collision(*model_.root_link_);
  };
  for (const PlacedLink& placed : order) {
    if (has_collision(*placed.link)) carriers.emplace(placed.link->name, placed.link->name);
  }
  const bool has_bodies = !carriers.empty();
  const auto carry = [&](const std::string& link, const std::string& by) {
    const auto found = carriers.find(by);
    if (found != carriers.end()) carriers.try_emplace(link, found->second);
  };
  // Up from the leaves, then down to them: joints are in the order of the tree.
  std::vector<const urdf::Joint*> fixed = joints;
  std::erase_if(fixed, [](const urdf::Joint* joint) { return joint->type != urdf::Joint::FIXED; });
  for (auto joint = fixed.rbegin(); joint != fixed.rend(); ++joint) {
    const std::string& parent = (*joint)->parent_link_name;
    if (!is_world(parent)) carry(parent, (*joint)->child_link_name);
  }
  for (const urdf::Joint* joint : fixed) carry(joint->child_link_name, joint->parent_link_name);
  std::map<std::string, Affine> poses;
  std::vector<const PlacedLink*> carried;
  for (const PlacedLink& placed : order) {
    poses.emplace(placed.link->name, placed.root_from_link);
    const auto carrier = carriers.find(placed.link->name);
    if (carrier != carriers.end() && carrier->second != placed.link->name) {
      carried.push_back(&placed);
      continue;
    }
    const NodeId node = add_link(*placed.link, root, placed.root_from_link);
    const bool is_held = carrier != carriers.end() || is_world(placed.link->name);
    if (has_bodies && !is_held && !joints.empty()) {
      make_body(*placed.link, node, kLightBody);
    }
  }
  for (const PlacedLink* placed : carried) {
    const std::string& carrier = carriers.at(placed->link->name);
    add_link(*placed->link, links_.at(carrier),
             poses.at(carrier).inverse() * placed->root_from_link);
  }
}

NodeId ModelTranslator::add_link(const urdf::Link& link, NodeId above,
                                 const Affine& above_from_link) {
  const NodeId node = scene_.create(above, node_name(link.name, "link"));
  links_[link.name] = node;
  if (above_from_link.matrix().allFinite()) scene_.set_pose(node, above_from_link);
  std::vector<std::pair<const urdf::Visual*, NodeId>> seen;
  for (const auto& visual : link.visual_array) {
    if (!visual || !visual->geometry) continue;
    const NodeId shape = add_geometry(*visual->geometry, visual->origin,
                                      node_name(visual->name, "visual"), node, false);
    if (!shape) continue;
    seen.emplace_back(visual.get(), shape);
    if (const auto material = material_of(*visual)) {
      for (const NodeId below : scene_.subtree(shape)) {
        // Meshes have materials of their own.
        if (scene_[below].mesh && scene_[below].materials.empty()) {
          scene_.edit(below).materials = {material};
        }
      }
    }
  }
  bool collides = false;
  for (const auto& collision : link.collision_array) {
    if (!collision || !collision->geometry) continue;
    // What is seen as it collides is one shape.
    const auto same = std::find_if(seen.begin(), seen.end(), [&](const auto& entry) {
      return are_equal(*entry.first->geometry, *collision->geometry) &&
             are_equal(entry.first->origin, collision->origin);
    });
    NodeId shape = same == seen.end() ? NodeId{} : same->second;
    if (!shape) {
      shape = add_geometry(*collision->geometry, collision->origin,
                           node_name(collision->name, "collision"), node, true);
    }
    if (!shape) continue;
    for (const NodeId below : scene_.subtree(shape)) {
      if (!scene_[below].mesh) continue;
      Collider collider;
      collider.primitive = primitive_of(*collision->geometry);
      if (collider.primitive != PrimitiveShape::None) {
        collider.shape = ColliderShape::Primitive;
        collider.primitive_size = scene_[below].mesh->bounds().size();
      }
      scene_.edit(below).collider = collider;
      collides = true;
    }
  }
  if (collides) make_body(link, node, RigidBody().mass_kg);
  return node;
}

void ModelTranslator::make_body(const urdf::Link& link, NodeId node, double unsaid_mass_kg) {
  RigidBody body;
  body.mass_kg = unsaid_mass_kg;
  if (link.inertial) {
    if (is_length(link.inertial->mass)) {
      body.mass_kg = link.inertial->mass;
    } else {
      warn("link '" + link.name + "' has a mass that is not above 0; it weighs " +
           (unsaid_mass_kg < 1.0 ? "0.1 kg" : "1 kg"));
    }
  }
  scene_.edit(node).rigid_body = body;
}

NodeId ModelTranslator::add_geometry(const urdf::Geometry& geometry, const urdf::Pose& pose,
                                     const std::string& name, NodeId link, bool is_collision) {
  const std::string where = "link '" + scene_[link].name + "'";
  Affine link_from_shape = pose_of(pose, where);
  if (geometry.type != urdf::Geometry::MESH) {
    auto shape = mesh_of(geometry);
    if (!shape) {
      warn(where + " has a shape without a size; it is left out");
      return {};
    }
    const NodeId node = scene_.create(link, name);
    scene_.set_pose(node, link_from_shape);
    Node& content = scene_.edit(node);
    content.mesh = std::make_shared<const Mesh>(std::move(*shape));
    content.is_visible = !is_collision;
    return node;
  }
  const auto& mesh = static_cast<const urdf::Mesh&>(geometry);
  const auto file = meshes_.find(mesh.filename);
  if (!file) {
    missing_.push_back(where + ": there is no file " + mesh.filename);
    return {};
  }
  if (is_model(*file)) {
    warn(where + " names a model as a mesh; it is left out");
    return {};
  }
  const Vec3 scale = to_vec3(mesh.scale);
  if (!scale.allFinite() || (scale.array() == 0.0).any()) {
    warn(where + " has a mesh without a size; it is left out");
    return {};
  }
  const NodeId node = scene_.create(link, name);
  link_from_shape.linear() *= scale.asDiagonal();
  scene_.set_pose(node, link_from_shape);
  if (is_collision) scene_.edit(node).is_visible = false;
  host_.load_asset(file->string(), scene_, node);
  return node;
}

std::shared_ptr<const Material> ModelTranslator::material_of(const urdf::Visual& visual) {
  if (!visual.material) return nullptr;
  const urdf::Material& said = *visual.material;
  // Names stand for one material each; without a name each is its own.
  const auto known = materials_.find(said.name);
  if (known != materials_.end()) return known->second;
  auto material = std::make_shared<Material>();
  material->name = said.name;
  material->base_color = Vec3f(linear_of_srgb(said.color.r), linear_of_srgb(said.color.g),
                               linear_of_srgb(said.color.b));
  if (std::isfinite(said.color.a)) material->opacity = std::clamp(said.color.a, 0.0f, 1.0f);
  if (!said.texture_filename.empty()) {
    if (const auto file = meshes_.find(said.texture_filename)) {
      auto& texture = textures_[*file];
      if (!texture) texture = host_.read_texture(*file);
      material->base_color_texture.texture = texture;
      material->base_color = Vec3f::Ones();
      material->opacity = 1.0f;
    } else {
      missing_.push_back("material '" + said.name + "': there is no file " + said.texture_filename);
    }
  }
  if (!said.name.empty()) materials_.emplace(said.name, material);
  return material;
}

void ModelTranslator::add_joint(const urdf::Joint& said, NodeId above) {
  const std::string where = "joint '" + said.name + "'";
  const loader_support::JointEnd parent{links_.at(said.parent_link_name),
                                        pose_of(said.parent_to_joint_origin_transform, where)};
  const loader_support::JointEnd child{links_.at(said.child_link_name)};
  if (said.type == urdf::Joint::FLOATING || said.type == urdf::Joint::PLANAR) {
    return add_free_joint(said, above, parent, child);
  }
  Joint joint;
  if (said.type == urdf::Joint::REVOLUTE || said.type == urdf::Joint::CONTINUOUS) {
    joint.kind = JointKind::Revolute;
  } else if (said.type == urdf::Joint::PRISMATIC) {
    joint.kind = JointKind::Prismatic;
  } else if (said.type != urdf::Joint::FIXED) {
    warn(where + " is of a type that is not known; it holds nothing");
    return;
  }
  if (joint.kind != JointKind::Fixed) joint.axis = axis_of(said);
  if (said.limits && joint.kind != JointKind::Fixed && said.type != urdf::Joint::CONTINUOUS) {
    const auto [lower, upper] = std::pair(said.limits->lower, said.limits->upper);
    if (std::isnan(lower) || std::isnan(upper)) {
      warn(where + " has limits that are no interval; it has none");
    } else {
      if (lower > upper) warn(where + " has limits the wrong way round; they are swapped");
      joint.lower = std::min(lower, upper);
      joint.upper = std::max(lower, upper);
    }
  }
  const NodeId node = scene_.create(above, node_name(said.name, "joint"));
  if (!loader_support::add_joint(scene_, node, {joint}, {}, parent, child)) {
    warn(where + " is too far away to be told in numbers; it holds nothing");
    return;
  }
  joints_[said.name] = node;
}

Vec3 ModelTranslator::axis_of(const urdf::Joint& said) {
  const Vec3 axis = to_vec3(said.axis);
  if (axis.allFinite() && axis.norm() > 1e-9) return axis.normalized();
  warn("joint '" + said.name + "' has no axis; it is x");
  return Vec3::UnitX();
}

/// Floating joints allow everything, planar ones what keeps a plane: to slide in it, and to turn
/// about its normal.
void ModelTranslator::add_free_joint(const urdf::Joint& said, NodeId above,
                                     const loader_support::JointEnd& parent,
                                     const loader_support::JointEnd& child) {
  const bool is_planar = said.type == urdf::Joint::PLANAR;
  const Vec3 normal = is_planar ? axis_of(said) : Vec3::UnitZ();
  const Mat3 axes = Quat::FromTwoVectors(Vec3::UnitZ(), normal).toRotationMatrix();
  std::vector<Joint> joints;
  std::vector<std::string> names;
  const auto add = [&](JointKind kind, int column) {
    Joint joint;
    joint.kind = kind;
    joint.axis = axes.col(column);
    joints.push_back(joint);
    names.push_back((kind == JointKind::Revolute ? "rot" : "trans") +
                    std::string(1, "XYZ"[column]));
  };
  add(JointKind::Prismatic, 0);
  add(JointKind::Prismatic, 1);
  if (!is_planar) add(JointKind::Prismatic, 2);
  if (!is_planar) add(JointKind::Revolute, 0);
  if (!is_planar) add(JointKind::Revolute, 1);
  add(JointKind::Revolute, 2);
  const NodeId node = scene_.create(above, node_name(said.name, "joint"));
  if (!loader_support::add_joint(scene_, node, std::move(joints), names, parent, child)) {
    warn("joint '" + said.name + "' is too far away to be told in numbers; it holds nothing");
  }
}

}  // namespace diorama::loader_urdf
