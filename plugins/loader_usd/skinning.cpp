// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/skinning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "loader_usd/conversion.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;

constexpr std::size_t kMaxJoints = 100'000;
constexpr std::size_t kMaxInfluences = 1'000;
constexpr std::size_t kMaxShapes = 10'000;
// Of a joint's path: each part of it is looked up.
constexpr std::size_t kMaxPathLetters = 4'096;

usd::Strings texts(const usd::Value& value) {
  return value.as_strings() ? *value.as_strings() : usd::Strings{};
}

// The place of each joint's parent, -1 for roots: `hip/knee` hangs on `hip`. Parents that are left
// out are skipped. Empty when a joint stands before its parent, occurs twice or has a path without
// end.
std::optional<std::vector<int>> parents_of(const usd::Strings& joints) {
  std::map<std::string, int, std::less<>> place;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const bool is_new = place.emplace(joints[i], static_cast<int>(i)).second;
    if (!is_new || joints[i].size() > kMaxPathLetters) return std::nullopt;
  }
  std::vector<int> parents;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    int parent = -1;
    for (std::string_view up = joints[i]; parent < 0;) {
      const std::size_t slash = up.rfind('/');
      if (slash == std::string_view::npos) break;
      up = up.substr(0, slash);
      const auto found = place.find(up);
      if (found != place.end()) parent = found->second;
    }
    if (parent > static_cast<int>(i)) return std::nullopt;
    parents.push_back(parent);
  }
  return parents;
}

Affine linear_blend(const std::vector<Affine>& moves, const std::int32_t* joints,
                    const float* weights, std::size_t count, const std::vector<int>& places,
                    bool& is_sound) {
  Affine::MatrixType sum = Affine::MatrixType::Zero();
  double total = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const double weight = weights[k];
    if (weight == 0.0) continue;
    const auto joint = static_cast<std::size_t>(joints[k]);
    const bool exists = joints[k] >= 0 && joint < places.size() && places[joint] >= 0;
    if (!exists || !(weight > 0.0) || !std::isfinite(weight)) {
      is_sound = false;
      continue;
    }
    sum += weight * moves[static_cast<std::size_t>(places[joint])].matrix();
    total += weight;
  }
  if (!(total > 0.0)) return Affine::Identity();
  Affine result;
  result.matrix() = sum / total;
  return result;
}

void set_points(MeshSources& sources, const std::vector<Vec3>& points) {
  std::vector<float>& numbers = sources.points.converted;
  std::vector<float> moved(points.size() * 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      moved[3 * i + axis] = static_cast<float>(points[i][static_cast<Eigen::Index>(axis)]);
    }
  }
  numbers = std::move(moved);
  sources.points.span = numbers;
}

// Normals become those of corners, each turned as its point is.
void turn_normals(MeshSources& sources, const std::vector<Mat3>& turns) {
  if (!sources.normals) return;
  const CornerData& data = *sources.normals;
  CornerData turned;
  turned.width = 3;
  turned.interpolation = Interpolation::FaceVarying;
  std::vector<float>& numbers = turned.values.converted;
  numbers.reserve(3 * sources.indices.span.size());
  std::size_t corner = 0;
  for (std::size_t face = 0; face < sources.counts.span.size(); ++face) {
    for (std::int32_t k = 0; k < sources.counts.span[face]; ++k, ++corner) {
      if (corner >= sources.indices.span.size()) break;
      const std::int32_t index = sources.indices.span[corner];
      const auto point = static_cast<std::size_t>(index);
      const bool exists = index >= 0 && point < turns.size();
      const float* said = exists ? data.at(face, point, corner) : nullptr;
      Vec3 normal = said ? Vec3(said[0], said[1], said[2]) : Vec3::Zero();
      if (exists) normal = turns[point] * normal;
      for (int axis = 0; axis < 3; ++axis) numbers.push_back(static_cast<float>(normal[axis]));
    }
  }
  numbers.resize(3 * sources.indices.span.size(), 0.0f);
  turned.values.span = numbers;
  sources.normals = std::move(turned);
}

}  // namespace

const Prim* Skinning::target_of(const Prim& prim, const char* name) {
  for (const Prim* at = &prim; at; at = at->parent) {
    const usd::Strings targets = stage_.targets(*at, name);
    if (!targets.empty()) return stage_.find(targets.front());
    if (at->type_name == "SkelRoot") break;
  }
  return nullptr;
}

bool Skinning::applies_to(const Prim& prim) {
  if (!stage_.has_property(prim, "primvars:skel:jointIndices") &&
      !stage_.has_property(prim, "skel:blendShapes")) {
    return false;
  }
  const Prim* at = &prim;
  while (at && at->type_name != "SkelRoot") at = at->parent;
  return at != nullptr;
}

std::vector<Affine> Skinning::matrices(const Prim& prim, const char* name) const {
  std::vector<Affine> result;
  const auto numbers = usd::numbers<double>(stage_.value(prim, name), 16);
  if (!numbers) return result;
  for (std::size_t i = 0; i + 16 <= numbers->span.size(); i += 16) {
    usd::Matrix matrix;
    std::copy_n(numbers->span.begin() + static_cast<std::ptrdiff_t>(i), 16, matrix.m.begin());
    result.push_back(to_affine(matrix));
  }
  return result;
}

Skinning::Animation Skinning::read_animation(const Prim& prim) {
  Animation result;
  result.joints = texts(stage_.value(prim, "joints"));
  const auto places = usd::numbers<double>(stage_.value(prim, "translations"), 3);
  const auto turns = usd::numbers<double>(stage_.value(prim, "rotations"), 4);
  const auto sizes = usd::numbers<double>(stage_.value(prim, "scales"), 3);
  const std::size_t count = result.joints.size();
  const bool is_sound = places && turns && count <= kMaxJoints &&
                        places->span.size() == 3 * count && turns->span.size() == 4 * count &&
                        (!sizes || sizes->span.empty() || sizes->span.size() == 3 * count);
  result.is_broken = count > 0 && !is_sound;
  for (std::size_t i = 0; is_sound && i < count; ++i) {
    const auto t = places->span.subspan(3 * i, 3);
    const auto q = turns->span.subspan(4 * i, 4);  // i, j, k, real
    Affine pose = Affine::Identity();
    const Quat turn(q[3], q[0], q[1], q[2]);
    if (turn.coeffs().allFinite() && turn.norm() > 1e-12) {
      pose.linear() = turn.normalized().toRotationMatrix();
    }
    if (sizes && !sizes->span.empty()) {
      const auto s = sizes->span.subspan(3 * i, 3);
      pose.linear() *= Vec3(s[0], s[1], s[2]).asDiagonal();
    }
    pose.translation() = Vec3(t[0], t[1], t[2]);
    result.poses.push_back(pose.matrix().allFinite() ? pose : Affine::Identity());
  }
  const usd::Strings shapes = texts(stage_.value(prim, "blendShapes"));
  const auto weights = usd::numbers<double>(stage_.value(prim, "blendShapeWeights"), 1);
  for (std::size_t i = 0; weights && i < std::min(shapes.size(), weights->span.size()); ++i) {
    if (std::isfinite(weights->span[i])) result.weights[shapes[i]] = weights->span[i];
  }
  return result;
}

const Skinning::Animation& Skinning::animation(const Prim& prim) {
  const auto known = animations_.find(&prim);
  if (known != animations_.end()) return known->second;
  return animations_.emplace(&prim, read_animation(prim)).first->second;
}

const Skinning::Animation* Skinning::animation_of(const Prim& skeleton) {
  const Prim* source = target_of(skeleton, "skel:animationSource");
  return source && source->type_name == "SkelAnimation" ? &animation(*source) : nullptr;
}

Skinning::Skeleton Skinning::read_skeleton(const Prim& prim) {
  Skeleton result;
  result.joints = texts(stage_.value(prim, "joints"));
  const std::vector<Affine> bind = matrices(prim, "bindTransforms");
  std::vector<Affine> local = matrices(prim, "restTransforms");
  const auto parents =
      result.joints.size() <= kMaxJoints ? parents_of(result.joints) : std::nullopt;
  const std::size_t count = result.joints.size();
  if (!parents || bind.size() != count || (!local.empty() && local.size() != count)) {
    result.problem = "has a skeleton whose joints and matrices do not fit; it stays as it is bound";
    return result;
  }
  const auto parent = [&](std::size_t i) { return (*parents)[i]; };
  if (local.empty()) {
    // Without a pose at rest it is the bound one.
    for (std::size_t i = 0; i < count; ++i) {
      local.push_back(parent(i) < 0 ? bind[i]
                                    : Affine(bind[std::size_t(parent(i))].inverse() * bind[i]));
    }
  }
  result.animation = animation_of(prim);
  if (result.animation && !result.animation->poses.empty()) {
    std::map<std::string, std::size_t> place;
    for (std::size_t i = 0; i < count; ++i) place[result.joints[i]] = i;
    for (std::size_t i = 0; i < result.animation->poses.size(); ++i) {
      const auto joint = place.find(result.animation->joints[i]);
      if (joint != place.end()) local[joint->second] = result.animation->poses[i];
    }
  }
  std::vector<Affine> now;
  for (std::size_t i = 0; i < count; ++i) {
    now.push_back(parent(i) < 0 ? local[i] : Affine(now[std::size_t(parent(i))] * local[i]));
    const Affine moved = now[i] * bind[i].inverse();
    result.skeleton_from_bound.push_back(moved);
    if (!moved.matrix().allFinite()) {
      result.skeleton_from_bound.clear();
      result.problem = "has a skeleton with poses that are no numbers; it stays as it is bound";
      return result;
    }
  }
  return result;
}

const Skinning::Skeleton& Skinning::skeleton(const Prim& prim) {
  const auto known = skeletons_.find(&prim);
  if (known != skeletons_.end()) return known->second;
  return skeletons_.emplace(&prim, read_skeleton(prim)).first->second;
}

void Skinning::blend_shapes(const Prim& prim, const Animation& animation, std::vector<Vec3>& points,
                            MeshSources& sources, Losses& losses) {
  const usd::Strings names = texts(stage_.value(prim, "skel:blendShapes"));
  const usd::Strings targets = stage_.targets(prim, "skel:blendShapeTargets");
  if (names.size() != targets.size()) {
    losses.insert("has blend shapes whose names and targets do not fit, which are left out");
    return;
  }
  if (names.size() > kMaxShapes) {
    losses.insert("has more than " + std::to_string(kMaxShapes) +
                  " blend shapes, which are left out");
    return;
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto weight = animation.weights.find(names[i]);
    const Prim* shape = stage_.find(targets[i]);
    if (weight == animation.weights.end() || weight->second == 0.0 || !shape) continue;
    if (!stage_.property_names(*shape, "inbetweens:").empty()) {
      losses.insert("has blend shapes with shapes in between, which are left out");
    }
    const auto offsets = usd::numbers<float>(stage_.value(*shape, "offsets"), 3);
    if (!offsets) continue;
    const auto where = usd::numbers<std::int32_t>(stage_.value(*shape, "pointIndices"), 1);
    const std::size_t count = offsets->span.size() / 3;
    const bool has_places = where && !where->span.empty();
    if (has_places ? where->span.size() != count : count != points.size()) {
      losses.insert("has a blend shape of another number of points, which is left out");
      continue;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const std::int64_t point = has_places ? where->span[k] : static_cast<std::int64_t>(k);
      const Vec3 offset(offsets->span[3 * k], offsets->span[3 * k + 1], offsets->span[3 * k + 2]);
      if (point < 0 || point >= static_cast<std::int64_t>(points.size()) || !offset.allFinite()) {
        losses.insert("has a blend shape of points that do not exist");
        continue;
      }
      points[static_cast<std::size_t>(point)] += weight->second * offset;
    }
    // Those that were said are of another shape; the mean ones of the faces are right.
    sources.is_smooth = sources.is_smooth || sources.normals.has_value();
    sources.normals.reset();
  }
}

void Skinning::apply(const Prim& prim, MeshSources& sources, Losses& losses) {
  const std::size_t count = sources.points.span.size() / 3;
  std::vector<Vec3> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float* p = sources.points.span.data() + 3 * i;
    points[i] = Vec3(p[0], p[1], p[2]);
  }
  const Prim* bound = target_of(prim, "skel:skeleton");
  if (bound && bound->type_name != "Skeleton") bound = nullptr;
  const Skeleton* bones = bound ? &skeleton(*bound) : nullptr;
  const Animation* moves = bones ? bones->animation : nullptr;
  if (!bones) {
    const Prim* source = target_of(prim, "skel:animationSource");
    if (source && source->type_name == "SkelAnimation") moves = &animation(*source);
  }
  if (moves) {
    blend_shapes(prim, *moves, points, sources, losses);
    set_points(sources, points);
  }
  if (!bones) return;
  if (!bones->problem.empty()) losses.insert(bones->problem);
  if (moves && moves->is_broken) {
    losses.insert("has an animation whose joints and poses do not fit; they stay at rest");
  }
  if (bones->skeleton_from_bound.empty()) return;

  const auto joints =
      usd::numbers<std::int32_t>(stage_.value(prim, "primvars:skel:jointIndices"), 1);
  const auto weights = usd::numbers<float>(stage_.value(prim, "primvars:skel:jointWeights"), 1);
  if (!joints || !weights || joints->span.empty()) return;
  const usd::Value said =
      stage_.property_metadata(prim, "primvars:skel:jointIndices", "interpolation");
  const bool is_rigid = !said.as_text() || *said.as_text() == "constant";
  const double each = stage_.property_metadata(prim, "primvars:skel:jointIndices", "elementSize")
                          .as_number()
                          .value_or(is_rigid ? static_cast<double>(joints->span.size()) : 1.0);
  const auto influences = each >= 1.0 && each <= double(kMaxInfluences) ? std::size_t(each) : 0;
  if (influences == 0 || joints->span.size() != weights->span.size() ||
      joints->span.size() != influences * (is_rigid ? 1 : count)) {
    losses.insert("has influences of joints that do not fit its points; it stays as it is bound");
    return;
  }
  // The mesh may have an order of its own.
  const usd::Strings own = texts(stage_.value(prim, "skel:joints"));
  std::vector<int> places;
  if (own.empty()) {
    for (std::size_t i = 0; i < bones->joints.size(); ++i) places.push_back(static_cast<int>(i));
  } else {
    std::map<std::string, int> place;
    for (std::size_t i = 0; i < bones->joints.size(); ++i) {
      place[bones->joints[i]] = static_cast<int>(i);
    }
    for (const std::string& name : own) {
      const auto found = place.find(name);
      places.push_back(found == place.end() ? -1 : found->second);
    }
  }
  std::array<double, 16> numbers{};
  usd::Matrix geom_bind;
  if (stage_.value(prim, "primvars:skel:geomBindTransform").read(numbers)) geom_bind.m = numbers;
  const Affine skeleton_from_mesh = to_affine(geom_bind);
  // Bent in the skeleton's space, drawn in the mesh's.
  const Affine mesh_from_skeleton = to_affine(geometry_.world_from_prim(prim)).inverse() *
                                    to_affine(geometry_.world_from_prim(*bound));
  if (!mesh_from_skeleton.matrix().allFinite() || !skeleton_from_mesh.matrix().allFinite()) {
    losses.insert("is bound to a skeleton in a space without a size; it stays as it is bound");
    return;
  }
  bool is_sound = true;
  std::vector<Mat3> turns(count);
  Affine moved = Affine::Identity();
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = is_rigid ? 0 : influences * i;
    if (!is_rigid || i == 0) {
      moved = mesh_from_skeleton *
              linear_blend(bones->skeleton_from_bound, joints->span.data() + first,
                           weights->span.data() + first, influences, places, is_sound) *
              skeleton_from_mesh;
    }
    points[i] = moved * points[i];
    turns[i] = moved.linear().inverse().transpose();
    if (!turns[i].allFinite()) turns[i] = Mat3::Identity();
  }
  if (!is_sound) {
    losses.insert(
        "has influences of joints that do not exist or weigh less than nothing, which "
        "are left out");
  }
  set_points(sources, points);
  turn_normals(sources, turns);
}

}  // namespace diorama::loader_usd
