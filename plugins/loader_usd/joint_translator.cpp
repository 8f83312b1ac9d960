// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/joint_translator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "loader_support/joint_chain.h"
#include "loader_usd/usd/geometry.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;

Vec3 axis_named(const std::string& word) {
  if (word == "Y") return Vec3::UnitY();
  if (word == "Z") return Vec3::UnitZ();
  return Vec3::UnitX();
}

/// None: it holds its bodies as they stand. Joints without a kind of their own are free along and
/// about every axis but those whose limits are turned round; slides come first.
std::vector<FreeAxis> free_axes(usd::Stage& stage, const Prim& prim) {
  const auto number = [&](const std::string& name, double fallback) {
    return usd::number_or(stage, prim, name.c_str(), fallback);
  };
  // The second of three turns is ambiguous beyond a quarter: it is that which turns least.
  const auto reach = [](const FreeAxis& axis) { return std::max(-axis.lower, axis.upper); };
  const std::string& type = prim.type_name;
  const std::string word = usd::token_or(stage, prim, "physics:axis", "X");
  if (type == "PhysicsRevoluteJoint" || type == "PhysicsPrismaticJoint") {
    return {{"", type == "PhysicsRevoluteJoint" ? JointKind::Revolute : JointKind::Prismatic,
             axis_named(word), number("physics:lowerLimit", -kInfinity),
             number("physics:upperLimit", kInfinity)}};
  }
  if (type == "PhysicsSphericalJoint") {
    // The axis tilts towards the two after it within a cone, and turns freely. Within the cone, but
    // not all of it, lie two tilts that are each a square root of two smaller.
    const std::string letters = "XYZ";
    const std::size_t first = word == "Y" ? 1 : word == "Z" ? 2 : 0;
    std::vector<FreeAxis> axes;
    for (const std::size_t step : {1, 2, 0}) {
      const std::string letter(1, letters[(first + step) % 3]);
      FreeAxis axis{"rot" + letter, JointKind::Revolute, axis_named(letter)};
      const double cone =
          step == 0 ? -1.0
                    : number(step == 1 ? "physics:coneAngle0Limit" : "physics:coneAngle1Limit", -1);
      if (cone >= 0.0 && cone < 180.0) {
        axis.lower = -std::sqrt(0.5) * cone;
        axis.upper = -axis.lower;
      }
      axes.push_back(axis);
    }
    if (reach(axes[1]) > 90.0 && reach(axes[0]) < reach(axes[1])) std::swap(axes[0], axes[1]);
    return axes;
  }
  std::vector<FreeAxis> axes;
  if (type != "PhysicsJoint") return axes;
  for (const char* name : {"transX", "transY", "transZ", "rotX", "rotY", "rotZ"}) {
    const std::string limit = "limit:" + std::string(name) + ":physics:";
    const double low = number(limit + "low", -kInfinity);
    const double high = number(limit + "high", kInfinity);
    if (low > high || (low == 0.0 && high == 0.0)) continue;  // locked
    const bool turns = std::string_view(name).starts_with("rot");
    axes.push_back({name, turns ? JointKind::Revolute : JointKind::Prismatic,
                    axis_named(std::string(1, std::string_view(name).back())), low, high});
  }
  const auto turns = std::ranges::find(axes, JointKind::Revolute, &FreeAxis::kind);
  if (axes.end() - turns == 3 && reach(turns[1]) > 90.0) {
    const auto least = std::ranges::min_element(turns, axes.end(), {}, reach);
    if (reach(*least) < reach(turns[1])) std::swap(turns[1], *least);
  }
  return axes;
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

Joint JointTranslator::joint_of(const Prim& prim, const FreeAxis& free, double meters_per_unit) {
  Joint joint;
  joint.kind = free.kind;
  joint.axis = free.axis;
  const auto limit = [&](double number, double fallback) {
    if (!std::isnan(number)) return number;
    note_(prim, "is a joint with a limit that is no number; it has none there", {});
    return fallback;
  };
  const double unit = joint.kind == JointKind::Revolute ? kPi / 180.0 : meters_per_unit;
  joint.lower = unit * limit(free.lower, -kInfinity);
  joint.upper = unit * limit(free.upper, kInfinity);
  // In units of no length they are no numbers.
  if (!(joint.lower <= joint.upper)) {
    note_(prim, "is a joint with limits that are no interval; it has none", {});
    joint.lower = -kInfinity;
    joint.upper = kInfinity;
  }
  return joint;
}

void JointTranslator::translate(const Prim& prim, NodeId node, double meters_per_unit) {
  if (!usd::bool_or(stage_, prim, "physics:jointEnabled", true)) return;
  Side first = side(prim, '0');
  Side second = side(prim, '1');
  if (!first.is_known || !second.is_known) return;
  const bool is_reversed = second.is_world;
  if (is_reversed) std::swap(first, second);
  if (first.body == second.body) {
    note_(prim, "is a joint of a body with itself, and holds nothing", {});
    return;
  }
  if (first.is_world) first.body = world_body();
  std::vector<Joint> joints;
  std::vector<std::string> names;
  for (const FreeAxis& free : free_axes(stage_, prim)) {
    joints.push_back(joint_of(prim, free, meters_per_unit));
    names.push_back(free.name);
    if (is_reversed) joints.back().axis = -joints.back().axis;
  }
  if (is_reversed && joints.size() > 1) {
    // The last turn is the first from the other side; slides would come after turns.
    const auto turns = [](const Joint& joint) { return joint.kind == JointKind::Revolute; };
    if (std::ranges::any_of(joints, turns) && !std::ranges::all_of(joints, turns)) {
      note_(prim, "is a joint to the world that slides and turns, and holds nothing", {});
      return;
    }
    std::ranges::reverse(joints);
    std::ranges::reverse(names);
  }
  if (joints.empty()) joints.emplace_back();
  const Affine parent_from_joint =
      scene_.world_from_node(first.body).inverse() * first.world_from_joint;
  const Affine child_from_joint =
      scene_.world_from_node(second.body).inverse() * second.world_from_joint;
  const bool has_room =
      joints.size() == 1 || scene_.world_from_node(node).inverse().matrix().allFinite();
  if (!parent_from_joint.matrix().allFinite() || !child_from_joint.matrix().allFinite() ||
      !has_room) {
    note_(prim, "is a joint of a body or in a prim without a size, and holds nothing", {});
    return;
  }
  if (!loader_support::add_joint(scene_, node, std::move(joints), names,
                                 {first.body, parent_from_joint},
                                 {second.body, child_from_joint})) {
    note_(prim, "is a joint of places that are no numbers, and holds nothing", {});
  }
}

}  // namespace diorama::loader_usd
