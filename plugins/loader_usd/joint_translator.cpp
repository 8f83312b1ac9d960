// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/joint_translator.h"

#include <array>
#include <cmath>
#include <utility>

#include "loader_usd/usd/geometry.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;

Vec3 axis_named(const std::string& word) {
  if (word == "Y") return Vec3::UnitY();
  if (word == "Z") return Vec3::UnitZ();
  return Vec3::UnitX();
}

/// What a joint leaves free, and where its limits are said.
struct Freedom {
  JointKind kind = JointKind::Fixed;
  std::string axis;
  std::string lower, upper;
  std::size_t turns = 0, slides = 0;  ///< Axes that are free.
};

/// Joints without a kind of their own are free along and about every axis but those whose limits
/// are turned round.
Freedom freedom_of(usd::Stage& stage, const Prim& prim) {
  if (prim.type_name != "PhysicsJoint") {
    Freedom one{JointKind::Fixed, usd::token_or(stage, prim, "physics:axis", "X"),
                "physics:lowerLimit", "physics:upperLimit"};
    if (prim.type_name == "PhysicsRevoluteJoint") one.kind = JointKind::Revolute;
    if (prim.type_name == "PhysicsPrismaticJoint") one.kind = JointKind::Prismatic;
    if (prim.type_name == "PhysicsSphericalJoint") one.turns = 3;
    return one;
  }
  Freedom found;
  for (const char* word : {"transX", "transY", "transZ", "rotX", "rotY", "rotZ"}) {
    const std::string name(word);
    const std::string lower = "limit:" + name + ":physics:low";
    const std::string upper = "limit:" + name + ":physics:high";
    const double low = usd::number_or(stage, prim, lower.c_str(), -kInfinity);
    const double high = usd::number_or(stage, prim, upper.c_str(), kInfinity);
    if (low > high || (low == 0.0 && high == 0.0)) continue;  // locked
    const bool turns = name.starts_with("rot");
    ++(turns ? found.turns : found.slides);
    found.kind = turns ? JointKind::Revolute : JointKind::Prismatic;
    found.axis = name.substr(name.size() - 1);
    found.lower = lower;
    found.upper = upper;
  }
  if (found.turns + found.slides != 1) found.kind = JointKind::Fixed;
  return found;
}

}  // namespace

bool is_joint(const std::string& type) {
  return type == "PhysicsRevoluteJoint" || type == "PhysicsPrismaticJoint" ||
         type == "PhysicsFixedJoint" || type == "PhysicsSphericalJoint" || type == "PhysicsJoint";
}

bool is_foreign_joint(const std::string& type) { return type == "PhysicsDistanceJoint"; }

NodeId JointTranslator::body_at_or_above(const Prim& prim) const {
  for (const Prim* at = &prim; at; at = at->parent) {
    const auto node = nodes_.find(at);
    if (node != nodes_.end() && usd::has_schema(stage_, *at, "PhysicsRigidBodyAPI")) {
      return node->second;
    }
  }
  const auto node = nodes_.find(&prim);
  return node == nodes_.end() ? NodeId{} : node->second;
}

// Nothing lies below it: what is held to the world collides with everything there.
NodeId JointTranslator::world_body() {
  if (!world_body_) world_body_ = scene_.create(world_, "world");
  return world_body_;
}

// Where the joint is by the words about one of its bodies.
JointTranslator::Side JointTranslator::side(const Prim& prim, char number) {
  Side result;
  const std::string digit(1, number);
  const usd::Strings bodies = stage_.targets(prim, "physics:body" + digit);
  const Prim* target = bodies.empty() ? nullptr : stage_.find(bodies.front());
  const auto node = nodes_.find(target);
  result.is_world = bodies.empty();
  result.is_known = bodies.empty() || (target && node != nodes_.end());
  if (!result.is_known) {
    note_(prim, "is a joint of a body that is not there, and holds nothing",
          "<" + bodies.front() + ">");
    return result;
  }
  if (!result.is_world) result.body = body_at_or_above(*target);
  const Affine world_from_body = result.is_world
                                     ? scene_.world_from_node(world_) * world_from_stage_
                                     : scene_.world_from_node(node->second);
  Vec3 place = Vec3::Zero();
  if (const auto at = usd::vector3(stage_, prim, "physics:localPos" + digit)) {
    place = Vec3((*at)[0], (*at)[1], (*at)[2]);
  }
  std::array<double, 4> turn{0.0, 0.0, 0.0, 1.0};  // i, j, k, real
  stage_.value(prim, "physics:localRot" + digit).read(turn);
  Quat rotation(turn[3], turn[0], turn[1], turn[2]);
  const bool is_sound =
      place.allFinite() && rotation.coeffs().allFinite() && rotation.norm() > 1e-9;
  if (!is_sound) {
    note_(prim, "is a joint whose place is no number; it counts as its body's", {});
    place.setZero();
    rotation.setIdentity();
  }
  const Transform body = Transform::from_affine(world_from_body);
  result.world_from_joint.translation() = world_from_body * place;
  result.world_from_joint.linear() = (body.rotation * rotation.normalized()).toRotationMatrix();
  return result;
}

double JointTranslator::limit(const Prim& prim, const char* name, double fallback) {
  const double number = usd::number_or(stage_, prim, name, fallback);
  if (!std::isnan(number)) return number;
  note_(prim, "is a joint with a limit that is no number; it has none there", {});
  return fallback;
}

void JointTranslator::translate(const Prim& prim, NodeId node, double meters_per_unit) {
  if (!usd::bool_or(stage_, prim, "physics:jointEnabled", true)) return;
  Side first = side(prim, '0');
  Side second = side(prim, '1');
  if (!first.is_known || !second.is_known) return;
  Joint joint;
  const Freedom freedom = freedom_of(stage_, prim);
  joint.kind = freedom.kind;
  joint.axis = axis_named(freedom.axis);
  if (second.is_world) {
    std::swap(first, second);
    joint.axis = -joint.axis;
  }
  if (first.body == second.body) {
    note_(prim, "is a joint of a body with itself, and holds nothing", {});
    return;
  }
  if (freedom.slides + freedom.turns > 1) {
    if (freedom.slides > 0) {
      note_(prim,
            "is a joint that lets its bodies slide along or beside several axes, and holds "
            "nothing",
            {});
      return;
    }
    note_(prim,
          "is a joint that turns about several axes, which it does not here: it holds its "
          "bodies as they stand",
          {});
  }
  if (first.is_world) first.body = world_body();
  if (joint.kind != JointKind::Fixed) {
    const double unit = joint.kind == JointKind::Revolute ? kPi / 180.0 : meters_per_unit;
    joint.lower = unit * limit(prim, freedom.lower.c_str(), -kInfinity);
    joint.upper = unit * limit(prim, freedom.upper.c_str(), kInfinity);
    // In units of no length they are no numbers.
    if (!(joint.lower <= joint.upper)) {
      note_(prim, "is a joint with limits that are no interval; it has none", {});
      joint.lower = -kInfinity;
      joint.upper = kInfinity;
    }
  }
  joint.parent_body = first.body;
  joint.child_body = second.body;
  joint.parent_from_joint = scene_.world_from_node(first.body).inverse() * first.world_from_joint;
  joint.child_from_joint = scene_.world_from_node(second.body).inverse() * second.world_from_joint;
  const bool is_finite =
      joint.parent_from_joint.matrix().allFinite() && joint.child_from_joint.matrix().allFinite();
  if (!is_finite) {
    note_(prim, "is a joint of a body without a size, and holds nothing", {});
    return;
  }
  scene_.edit(node).joint = joint;
}

}  // namespace diorama::loader_usd
