// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/physics_view.h"

#include <algorithm>

namespace diorama {
namespace {

bool are_equal(const std::optional<Collider>& a, const std::optional<Collider>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->shape == b->shape && a->primitive == b->primitive &&
         a->primitive_size == b->primitive_size && a->friction == b->friction &&
         a->restitution == b->restitution;
}

bool are_equal(const std::optional<RigidBody>& a, const std::optional<RigidBody>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->mass_kg == b->mass_kg && a->has_gravity == b->has_gravity &&
         a->linear_velocity == b->linear_velocity && a->angular_velocity == b->angular_velocity;
}

bool are_equal(const std::optional<Joint::Mimic>& a, const std::optional<Joint::Mimic>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->joint == b->joint && a->multiplier == b->multiplier && a->offset == b->offset;
}

bool are_equal(const std::optional<Joint>& a, const std::optional<Joint>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->kind == b->kind && a->parent_body == b->parent_body && a->child_body == b->child_body &&
         a->parent_from_joint.matrix() == b->parent_from_joint.matrix() &&
         a->child_from_joint.matrix() == b->child_from_joint.matrix() && a->axis == b->axis &&
         a->lower == b->lower && a->upper == b->upper && are_equal(a->mimic, b->mimic);
}

}  // namespace

PhysicsView::PhysicsView(const Scene& scene)
    : pose_revision_(scene.pose_revision()),
      shape_revision_(scene.shape_revision()),
      parts_(parts_of(scene)) {}

std::vector<PhysicsView::Part> PhysicsView::parts_of(const Scene& scene) {
  std::vector<Part> parts;
  for (const NodeId id : scene.subtree(scene.root())) {
    const Node& node = scene[id];
    if (!node.collider && !node.rigid_body && !node.joint) continue;
    parts.push_back({id, scene.world_from_node(id).matrix(), node.mesh, node.collider,
                     node.rigid_body, node.joint, scene.is_visible(id)});
  }
  return parts;
}

bool PhysicsView::are_equal(const Part& a, const Part& b) {
  return a.node == b.node && a.world_from_node == b.world_from_node && a.mesh == b.mesh &&
         diorama::are_equal(a.collider, b.collider) && diorama::are_equal(a.body, b.body) &&
         diorama::are_equal(a.joint, b.joint) && a.is_visible == b.is_visible;
}

bool PhysicsView::is_of(const Scene& scene) const {
  if (scene.pose_revision() == pose_revision_ && scene.shape_revision() == shape_revision_) {
    return true;
  }
  const std::vector<Part> now = parts_of(scene);
  return std::equal(parts_.begin(), parts_.end(), now.begin(), now.end(),
                    [](const Part& a, const Part& b) { return are_equal(a, b); });
}

void HiddenNodes::note_new(const Scene& scene) {
  const std::uint32_t known = first_unknown_;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (node.index < known) continue;
    first_unknown_ = std::max(first_unknown_, node.index + 1);
    if (!scene[node].is_visible) came_hidden_.insert(node);
  }
}

void HiddenNodes::hidden_by_job(const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) came_hidden_.erase(node);
}

HiddenNodes::Aside::Aside(Scene& scene, const HiddenNodes& hidden) : scene_(scene) {
  take(scene.root(), false, hidden);
  for (const Part& part : parts_) {
    Node& edited = scene_.edit(part.node);
    edited.collider.reset();
    edited.rigid_body.reset();
  }
}

void HiddenNodes::Aside::take(NodeId node, bool is_hidden, const HiddenNodes& hidden) {
  const Node& known = scene_[node];
  is_hidden = is_hidden || (!known.is_visible && !hidden.came_hidden_.contains(node));
  if (is_hidden && (known.collider || known.rigid_body)) {
    Part& part = parts_.emplace_back(Part{node, known.collider, known.rigid_body});
    if (part.body) {
      part.body->linear_velocity = Vec3::Zero();
      part.body->angular_velocity = Vec3::Zero();
    }
  }
  for (const NodeId child : known.children) take(child, is_hidden, hidden);
}

HiddenNodes::Aside::~Aside() {
  for (const Part& part : parts_) {
    Node& edited = scene_.edit(part.node);
    edited.collider = part.collider;
    edited.rigid_body = part.body;
  }
}

}  // namespace diorama
