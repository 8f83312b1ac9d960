// SPDX-License-Identifier: Apache-2.0
#include "extent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>

#include "geometry.h"
#include "path.h"

namespace diorama::usd {
namespace {

constexpr int kMaxInstancerNesting = 8;

std::optional<Box> extent_at(Stage& stage, const Prim& prim, int nesting);

Box around_axis(const std::string& axis, double radius, double half_height) {
  Vector3 half{radius, radius, radius};
  half[axis == "X" ? 0 : axis == "Y" ? 1 : 2] = half_height;
  Box box;
  box.min = {-half[0], -half[1], -half[2]};
  box.max = half;
  return box;
}

std::optional<Box> authored_extent(const Stage& stage, const Prim& prim) {
  const auto extent = numbers<float>(stage.value(prim, "extent"), 3);
  if (!extent || extent->span.size() != 6) return std::nullopt;
  Box box;
  box.min = {extent->span[0], extent->span[1], extent->span[2]};
  box.max = {extent->span[3], extent->span[4], extent->span[5]};
  return box;
}

// Points are balls of their own width, curves are as wide as their widest point.
std::optional<Box> points_extent(const Stage& stage, const Prim& prim) {
  const auto points = numbers<float>(stage.value(prim, "points"), 3);
  if (!points) return std::nullopt;
  const bool has_widths = prim.type_name == "Points" || prim.type_name.ends_with("Curves");
  const auto widths = numbers<float>(stage.value(prim, "widths"), 1);
  const std::size_t count = points->span.size() / 3;
  float widest = 0.0f;
  if (has_widths && widths) {
    if (prim.type_name == "Points" && widths->span.size() != count) return std::nullopt;
    for (const float width : widths->span) widest = std::max(widest, width);
  }
  Box box;
  for (std::size_t i = 0; i < count; ++i) {
    double half = widest / 2.0;
    if (prim.type_name == "Points" && widths) half = widths->span[i] / 2.0;
    for (const double offset : {-half, half}) {
      box.add(Vector3{points->span[i * 3] + offset, points->span[i * 3 + 1] + offset,
                      points->span[i * 3 + 2] + offset});
    }
  }
  if (box.is_empty()) return std::nullopt;
  return box;
}

std::optional<Box> shape_extent(const Stage& stage, const Prim& prim) {
  const std::string& type = prim.type_name;
  const std::string axis = token_or(stage, prim, "axis", "Z");
  const auto number = [&](const char* name, double fallback) {
    return number_or(stage, prim, name, fallback);
  };
  if (type == "Cube") {
    const double half = number("size", 2.0) / 2.0;
    return around_axis(axis, half, half);
  }
  if (type == "Sphere") {
    const double radius = number("radius", 1.0);
    return around_axis(axis, radius, radius);
  }
  if (type == "Cylinder" || type == "Cone") {
    return around_axis(axis, number("radius", 1.0), number("height", 2.0) / 2.0);
  }
  if (type == "Cylinder_1") {
    const double radius = std::max(number("radiusTop", 1.0), number("radiusBottom", 1.0));
    return around_axis(axis, radius, number("height", 2.0) / 2.0);
  }
  if (type == "Capsule") {
    const double radius = number("radius", 0.5);
    return around_axis(axis, radius, number("height", 1.0) / 2.0 + radius);
  }
  if (type == "Capsule_1") {
    const double radius = std::max(number("radiusTop", 0.5), number("radiusBottom", 0.5));
    return around_axis(axis, radius, number("height", 1.0) / 2.0 + radius);
  }
  if (type == "Plane") {
    const double width = number("width", 2.0) / 2.0;
    const double length = number("length", 2.0) / 2.0;
    Vector3 half{width, length, 0.0};
    if (axis == "X") half = {0.0, length, width};
    if (axis == "Y") half = {width, 0.0, length};
    Box box;
    box.min = {-half[0], -half[1], -half[2]};
    box.max = half;
    return box;
  }
  if (prim.traits.is_point_based) return points_extent(stage, prim);
  return std::nullopt;
}

// --- Instancers -----------------------------------------------------------------------------

std::vector<double> read_list(const Stage& stage, const Prim& prim, std::string_view name,
                              std::size_t width) {
  const auto list = numbers<double>(stage.value(prim, name), width);
  return list ? std::vector<double>(list->span.begin(), list->span.end()) : std::vector<double>();
}

// The box of a prim and all below it, in the space of that prim.
Box subtree_bounds(Stage& stage, const Prim& prim, int nesting) {
  Box result;
  if (token_or(stage, prim, "visibility", "inherited") == "invisible") return result;
  if (token_or(stage, prim, "purpose", "default") == "guide") return result;
  if (prim.traits.is_boundable) {
    if (const auto extent = extent_at(stage, prim, nesting)) return *extent;
  }
  for (const Prim* child : stage.visible_children(prim)) {
    result.add(
        transform(local_transform(stage, *child).matrix, subtree_bounds(stage, *child, nesting)));
  }
  return result;
}

std::optional<Box> instancer_extent(Stage& stage, const Prim& prim, int nesting) {
  if (nesting >= kMaxInstancerNesting) return std::nullopt;
  std::map<const Prim*, Box> bounds;
  Box result;
  for (const PointInstance& instance : point_instances(stage, prim).list) {
    auto [entry, is_new] = bounds.try_emplace(instance.prototype);
    if (is_new) entry->second = subtree_bounds(stage, *instance.prototype, nesting + 1);
    result.add(transform(instance.instancer_from_prototype, entry->second));
  }
  if (result.is_empty()) return std::nullopt;
  return result;
}

// --- Skeletons ------------------------------------------------------------------------------

std::vector<Matrix> read_matrices(const Stage& stage, const Prim& prim, std::string_view name) {
  const std::vector<double> numbers = read_list(stage, prim, name, 16);
  std::vector<Matrix> result(numbers.size() / 16);
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::copy_n(numbers.begin() + static_cast<std::ptrdiff_t>(i * 16), 16, result[i].m.begin());
  }
  return result;
}

// A relationship that holds for what is below, too.
const Prim* inherited_target(Stage& stage, const Prim& prim, std::string_view name) {
  for (const Prim* at = &prim; at; at = at->parent) {
    const Strings schemas = stage.metadata_list(*at, "apiSchemas");
    const bool is_bound =
        std::find(schemas.begin(), schemas.end(), "SkelBindingAPI") != schemas.end();
    if (!is_bound || !stage.has_property(*at, name)) continue;
    const Strings targets = stage.targets(*at, name);
    return targets.empty() ? nullptr : stage.find(targets.front());
  }
  return nullptr;
}

// Local transforms of the joints by the animation; the rest pose for those that it does not move.
// Nothing when the animation has no values.
std::optional<std::vector<Matrix>> animated_joints(const Stage& stage, const Prim& animation,
                                                   const Strings& joints,
                                                   std::vector<Matrix> rest) {
  const Value names = stage.value(animation, "joints");
  if (!names.as_strings()) return rest;
  const std::vector<double> translations = read_list(stage, animation, "translations", 3);
  const std::vector<double> rotations = read_list(stage, animation, "rotations", 4);
  const std::vector<double> scales = read_list(stage, animation, "scales", 3);
  const Strings& animated = *names.as_strings();
  const std::size_t count = animated.size();
  const bool is_complete = translations.size() == count * 3 && rotations.size() == count * 4 &&
                           scales.size() == count * 3;
  if (!is_complete) return std::nullopt;
  rest.resize(joints.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto joint = std::find(joints.begin(), joints.end(), animated[i]);
    if (joint == joints.end()) continue;
    const double* t = translations.data() + i * 3;
    const double* r = rotations.data() + i * 4;
    const double* s = scales.data() + i * 3;
    rest[static_cast<std::size_t>(joint - joints.begin())] =
        scaling({s[0], s[1], s[2]}) * rotation(std::array<double, 4>{r[0], r[1], r[2], r[3]}) *
        translation({t[0], t[1], t[2]});
  }
  return rest;
}

// Where the joints are in the space of the skeleton. Nothing for a skeleton without a pose.
std::optional<std::vector<Vector3>> joint_pivots(Stage& stage, const Prim& skeleton, bool at_rest) {
  const Value names = stage.value(skeleton, "joints");
  if (!names.as_strings() || names.as_strings()->empty()) return std::nullopt;
  const Strings& joints = *names.as_strings();
  std::vector<Matrix> local = read_matrices(stage, skeleton, "restTransforms");
  const Prim* animation =
      at_rest ? nullptr : inherited_target(stage, skeleton, "skel:animationSource");
  if (animation && animation->type_name == "SkelAnimation") {
    if (auto posed = animated_joints(stage, *animation, joints, local)) local = std::move(*posed);
  }
  if (local.size() != joints.size()) return std::nullopt;
  std::vector<Vector3> pivots;
  std::vector<Matrix> world(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i) {
    world[i] = local[i];
    // Parents come before their children; the nearest one that is a joint counts.
    for (std::size_t slash = joints[i].rfind('/'); slash != std::string::npos && slash > 0;
         slash = joints[i].rfind('/', slash - 1)) {
      const auto parent = std::find(joints.begin(), joints.begin() + static_cast<std::ptrdiff_t>(i),
                                    joints[i].substr(0, slash));
      if (parent == joints.begin() + static_cast<std::ptrdiff_t>(i)) continue;
      world[i] = local[i] * world[static_cast<std::size_t>(parent - joints.begin())];
      break;
    }
    pivots.push_back({world[i].at(3, 0), world[i].at(3, 1), world[i].at(3, 2)});
  }
  return pivots;
}

Box box_of(const std::vector<Vector3>& points, const Matrix& matrix) {
  Box box;
  for (const Vector3& point : points) box.add(transform(matrix, point));
  return box;
}

std::optional<Box> skeleton_extent(Stage& stage, const Prim& prim) {
  const auto pivots = joint_pivots(stage, prim, false);
  if (!pivots) return std::nullopt;
  return box_of(*pivots, Matrix());
}

struct SkinnedPrims {
  std::vector<const Prim*> skeletons;
  std::multimap<const Prim*, const Prim*> by_skeleton;
};

void find_skinned(Stage& stage, const Prim& prim, SkinnedPrims& found) {
  for (const Prim* child : stage.visible_children(prim)) {
    if (child->type_name == "Skeleton") found.skeletons.push_back(child);
    const bool is_skinnable = child->traits.is_boundable && child->type_name != "Skeleton" &&
                              child->type_name != "SkelRoot";
    if (is_skinnable) {
      if (const Prim* skeleton = inherited_target(stage, *child, "skel:skeleton")) {
        found.by_skeleton.emplace(skeleton, child);
      }
    }
    find_skinned(stage, *child, found);
  }
}

// How far the skin of a prim reaches beyond the joints of the rest pose.
double skin_padding(Stage& stage, const Prim& prim, const Box& joints) {
  const auto extent = authored_extent(stage, prim);
  if (!extent || joints.is_empty()) return 0.0;
  Matrix bind;
  stage.value(prim, "primvars:skel:geomBindTransform").read(bind.m);
  const Box skin = transform(bind, *extent);
  double padding = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    padding = std::max({padding, joints.min[i] - skin.min[i], skin.max[i] - joints.max[i]});
  }
  return padding;
}

// The joints of all skeletons below, wrapped in as much skin as the rest pose has.
std::optional<Box> skeleton_root_extent(Stage& stage, const Prim& root) {
  SkinnedPrims found;
  find_skinned(stage, root, found);
  Geometry geometry(stage);
  const Matrix root_from_world = inverse(geometry.world_from_prim(root));
  Box result;
  for (const Prim* skeleton : found.skeletons) {
    const auto rest = joint_pivots(stage, *skeleton, true);
    const auto pivots = joint_pivots(stage, *skeleton, false);
    if (!rest || !pivots) continue;
    double padding = 0.0;
    const auto [first, last] = found.by_skeleton.equal_range(skeleton);
    for (auto at = first; at != last; ++at) {
      padding = std::max(padding, skin_padding(stage, *at->second, box_of(*rest, Matrix())));
    }
    Box box = box_of(*pivots, geometry.world_from_prim(*skeleton) * root_from_world);
    for (std::size_t i = 0; i < 3; ++i) {
      box.min[i] -= padding;
      box.max[i] += padding;
    }
    result.add(box);
  }
  if (result.is_empty()) {
    // OpenUSD reports the inverted range of an empty box here.
    result.min.fill(-std::numeric_limits<float>::max());
    result.max.fill(std::numeric_limits<float>::max());
  }
  return result;
}

std::optional<Box> extent_at(Stage& stage, const Prim& prim, int nesting) {
  if (auto extent = authored_extent(stage, prim)) return extent;
  if (prim.type_name == "PointInstancer") return instancer_extent(stage, prim, nesting);
  if (prim.type_name == "Skeleton") return skeleton_extent(stage, prim);
  if (prim.type_name == "SkelRoot") return skeleton_root_extent(stage, prim);
  return shape_extent(stage, prim);
}

}  // namespace

std::optional<Box> local_extent(Stage& stage, const Prim& prim) {
  return extent_at(stage, prim, 0);
}

PointInstances point_instances(Stage& stage, const Prim& instancer) {
  PointInstances result;
  const std::vector<double> which = read_list(stage, instancer, "protoIndices", 1);
  const std::vector<double> positions = read_list(stage, instancer, "positions", 3);
  const std::vector<double> scales = read_list(stage, instancer, "scales", 3);
  std::vector<double> turns = read_list(stage, instancer, "orientationsf", 4);
  if (turns.empty()) turns = read_list(stage, instancer, "orientations", 4);
  std::vector<double> ids = read_list(stage, instancer, "ids", 1);
  if (ids.size() != which.size()) {
    ids.resize(which.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<double>(i);
  }
  std::set<double> masked;
  for (const double id : read_list(stage, instancer, "invisibleIds", 1)) masked.insert(id);
  for (const std::int64_t id : stage.metadata_integers(instancer, "inactiveIds")) {
    masked.insert(static_cast<double>(id));
  }
  std::vector<const Prim*> prototypes;
  for (const std::string& path : stage.targets(instancer, "prototypes")) {
    prototypes.push_back(stage.find(path));
  }
  result.lacks_positions = positions.size() / 3 < which.size();
  for (std::size_t i = 0; i < which.size() && i * 3 + 2 < positions.size(); ++i) {
    if (masked.contains(ids[i])) continue;
    const bool is_known = which[i] >= 0.0 && which[i] < static_cast<double>(prototypes.size());
    PointInstance instance;
    if (is_known) instance.prototype = prototypes[static_cast<std::size_t>(which[i])];
    result.lacks_prototypes |= !instance.prototype;
    if (!instance.prototype || !instance.prototype->is_active) continue;
    Matrix matrix = local_transform(stage, *instance.prototype).matrix;
    if (i * 3 + 2 < scales.size()) {
      matrix = matrix * scaling({scales[i * 3], scales[i * 3 + 1], scales[i * 3 + 2]});
    }
    if (i * 4 + 3 < turns.size()) {
      matrix = matrix * rotation(std::array<double, 4>{turns[i * 4], turns[i * 4 + 1],
                                                       turns[i * 4 + 2], turns[i * 4 + 3]});
    }
    instance.instancer_from_prototype =
        matrix * translation({positions[i * 3], positions[i * 3 + 1], positions[i * 3 + 2]});
    result.list.push_back(instance);
  }
  return result;
}

}  // namespace diorama::usd
