// SPDX-License-Identifier: Apache-2.0
#include "framework/export/joint_export.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "diorama/joints.h"

namespace diorama::usd_export {
namespace {

/// The prim of that path, which begins with `top`.
Prim& prim_at(Prim& top, const std::string& path) {
  Prim* prim = &top;
  for (std::size_t at = path.find('/', 1); at != std::string::npos;) {
    const std::size_t end = path.find('/', at + 1);
    const std::string name = path.substr(at + 1, end == std::string::npos ? end : end - at - 1);
    prim = &*std::ranges::find(prim->children, name, &Prim::name);
    at = end;
  }
  return *prim;
}

bool is_empty(const Node& node) {
  return !node.mesh && !node.light && !node.camera && !node.collider && !node.rigid_body &&
         node.labels.empty();
}

/// Right-handed axes, of which the first turn is about x, the second about y and the third about z,
/// either way round: the order in which the loader takes those of a joint.
Mat3 usd_axes(const std::vector<const Joint*>& joints) {
  std::vector<Vec3> own;
  for (const JointKind kind : {JointKind::Revolute, JointKind::Prismatic}) {
    for (const Joint* joint : joints) {
      if (joint->kind != kind) continue;
      const bool is_new = std::ranges::none_of(
          own, [&](const Vec3& axis) { return std::abs(axis.dot(joint->axis)) > 0.5; });
      if (is_new) own.push_back(joint->axis);
    }
  }
  Mat3 axes;
  axes.col(0) = own[0];
  axes.col(1) = own.size() > 1 ? own[1] : Vec3(own[0].unitOrthogonal());
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

void add_side(Prim& prim, const char* number, const std::string& path,
              const Affine& world_from_body, const Affine& world_from_joint) {
  const std::string side(number);
  prim.relate("physics:body" + side, path);
  const Vec3 place = world_from_body.inverse() * Vec3(world_from_joint.translation());
  prim.set("physics:localPos" + side, "point3f", Vec3f(place.cast<float>()));
  const Quat turn = Transform::from_affine(world_from_body).rotation.inverse() *
                    Transform::from_affine(world_from_joint).rotation;
  prim.set("physics:localRot" + side, "quatf", Eigen::Quaternionf(turn.cast<float>()));
}

void fill_joint(Prim& prim, const Scene& scene, const std::vector<const Joint*>& joints,
                const std::string& parent_path, const std::string& child_path) {
  const Joint& first = *joints.front();
  const Joint& last = *joints.back();
  const bool is_fixed = joints.size() == 1 && first.kind == JointKind::Fixed;
  const Mat3 axes = is_fixed ? Mat3(Mat3::Identity()) : usd_axes(joints);
  Affine turn = Affine::Identity();
  turn.linear() = axes;
  const Affine world_from_parent = scene.world_from_node(first.parent_body);
  const Affine world_from_child = scene.world_from_node(last.child_body);
  const Affine world_from_joint = world_from_parent * first.parent_from_joint;
  add_side(prim, "0", parent_path, world_from_parent, world_from_joint * turn);
  add_side(prim, "1", child_path, world_from_child,
           world_from_child * last.child_from_joint * turn);
  prim.type = is_fixed                            ? "PhysicsFixedJoint"
              : joints.size() > 1                 ? "PhysicsJoint"
              : first.kind == JointKind::Revolute ? "PhysicsRevoluteJoint"
                                                  : "PhysicsPrismaticJoint";
  if (is_fixed) return;
  const auto limit = [&](const std::string& name, double value) {
    prim.set(name, "float", float(value));
  };
  std::set<std::string> locked{"transX", "transY", "transZ", "rotX", "rotY", "rotZ"};
  for (const Joint* joint : joints) {
    const bool turns = joint->kind == JointKind::Revolute;
    const Vec3 parts = axes.transpose() * joint->axis;
    int column = 0;
    parts.cwiseAbs().maxCoeff(&column);
    // Joint space is in the asset's metres, the file in the world's.
    const double unit = turns ? 180.0 / kPi : (world_from_joint.linear() * joint->axis).norm();
    double lower = unit * joint->lower;
    double upper = unit * joint->upper;
    if (parts[column] < 0.0) std::tie(lower, upper) = std::pair(-upper, -lower);
    if (joints.size() == 1) {
      prim.set_uniform("physics:axis", "token", Token{"X"});
      if (std::isfinite(lower)) limit("physics:lowerLimit", lower);
      if (std::isfinite(upper)) limit("physics:upperLimit", upper);
      continue;
    }
    const std::string name = (turns ? "rot" : "trans") + std::string(1, "XYZ"[column]);
    locked.erase(name);
    if (!std::isfinite(lower) && !std::isfinite(upper)) continue;
    prim.api_schemas.push_back("PhysicsLimitAPI:" + name);
    if (std::isfinite(lower)) limit("limit:" + name + ":physics:low", lower);
    if (std::isfinite(upper)) limit("limit:" + name + ":physics:high", upper);
  }
  if (joints.size() == 1) return;
  for (const std::string& name : locked) {
    prim.api_schemas.push_back("PhysicsLimitAPI:" + name);
    limit("limit:" + name + ":physics:low", 1.0);
    limit("limit:" + name + ":physics:high", -1.0);
  }
}

}  // namespace

void add_joints(const Scene& scene, const std::map<NodeId, std::string>& paths, Prim& top) {
  std::map<NodeId, std::vector<NodeId>> chains;  // by their last joint
  std::set<NodeId> frames;
  for (CompoundJoint& compound : compound_joints(scene)) {
    frames.insert(compound.joints.begin(), compound.joints.end() - 1);
    const NodeId last = compound.joints.back();
    chains.emplace(last, std::move(compound.joints));
  }
  for (const NodeId id : joints_of(scene)) {
    if (frames.contains(id) || scene[id].joint->child_body == id) continue;
    const auto chain = chains.find(id);
    const std::vector<NodeId> joints =
        chain == chains.end() ? std::vector<NodeId>{id} : chain->second;
    std::vector<const Joint*> parts;
    for (const NodeId part : joints) parts.push_back(&*scene[part].joint);
    const auto parent = paths.find(parts.front()->parent_body);
    const auto child = paths.find(parts.back()->child_body);
    const bool is_inside =
        parent != paths.end() && child != paths.end() &&
        std::ranges::all_of(joints, [&](NodeId part) { return paths.contains(part); });
    if (!is_inside) continue;
    // A chain is one prim: that above it, if there is nothing else to it.
    NodeId place = id;
    const NodeId above = scene[id].parent;
    if (joints.size() > 1 && scene[above].children == joints && !scene[above].joint &&
        is_empty(scene[above]) && paths.contains(above) && paths.at(above).rfind('/') != 0) {
      place = above;
    }
    Prim& prim = prim_at(top, paths.at(place));
    const bool is_whole = place != id || (scene[id].children.empty() && is_empty(scene[id]));
    Prim joint;
    fill_joint(joint, scene, parts, parent->second, child->second);
    if (is_whole) {
      joint.name = prim.name;
      prim = std::move(joint);
    } else {
      joint.name = "joint";
      while (std::ranges::find(prim.children, joint.name, &Prim::name) != prim.children.end()) {
        joint.name += "_";
      }
      prim.children.push_back(std::move(joint));
    }
  }
}

}  // namespace diorama::usd_export
