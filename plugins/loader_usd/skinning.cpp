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

/// How the joints of a skeleton move what is bound to them.
class JointMoves {
 public:
  JointMoves(const std::vector<Affine>& moves, bool is_dual) : moves_(moves) {
    if (!is_dual) return;
    for (const Affine& move : moves) {
      Mat3 turn, stretch;
      move.computeRotationScaling(&turn, &stretch);
      turns_.push_back(Quat(turn));
      stretches_.push_back(stretch);
    }
  }

  /// Of a point that weighs so much on these joints, whose places among the moves are `places`.
  /// Without any weight it stays.
  Affine blend(const std::int32_t* joints, const float* weights, std::size_t count,
               const std::vector<int>& places, bool& is_sound) const {
    Blend sum;
    for (std::size_t k = 0; k < count; ++k) {
      const double weight = weights[k];
      if (weight == 0.0) continue;
      const auto joint = static_cast<std::size_t>(joints[k]);
      const bool exists = joints[k] >= 0 && joint < places.size() && places[joint] >= 0;
      if (!exists || !(weight > 0.0) || !std::isfinite(weight)) {
        is_sound = false;
        continue;
      }
      add(static_cast<std::size_t>(places[joint]), weight, sum);
    }
    if (!(sum.weight > 0.0)) return Affine::Identity();
    return turns_.empty() ? linear(sum) : dual(sum);
  }

 private:
  struct Blend {
    double weight = 0.0;
    Affine::MatrixType matrix = Affine::MatrixType::Zero();  ///< Linear blending only ...
    Eigen::Vector4d turn = Eigen::Vector4d::Zero();          ///< ... dual quaternions only.
    Eigen::Vector4d shift = Eigen::Vector4d::Zero();         ///< Their second halves.
    Mat3 stretch = Mat3::Zero();
  };
  void add(std::size_t joint, double weight, Blend& sum) const {
    sum.weight += weight;
    if (turns_.empty()) {
      sum.matrix += weight * moves_[joint].matrix();
      return;
    }
    const Quat& turn = turns_[joint];
    const Vec3 place = moves_[joint].translation();
    const Quat shift = Quat(0.0, 0.5 * place.x(), 0.5 * place.y(), 0.5 * place.z()) * turn;
    // Both signs are the same turn; of two joints the way between them is the shorter one.
    const double sign = sum.turn.dot(turn.coeffs()) < 0.0 ? -weight : weight;
    sum.turn += sign * turn.coeffs();
    sum.shift += sign * shift.coeffs();
    sum.stretch += weight * stretches_[joint];
  }
  static Affine linear(const Blend& sum) {
    Affine result;
    result.matrix() = sum.matrix / sum.weight;
    return result;
  }
  static Affine dual(const Blend& sum) {
    const double length = sum.turn.norm();
    if (!(length > 0.0)) return Affine::Identity();
    const Quat turn(Eigen::Vector4d(sum.turn / length));
    const Quat shift = Quat(Eigen::Vector4d(sum.shift / length)) * turn.conjugate();
    Affine result = Affine::Identity();
    result.linear() = turn.toRotationMatrix() * (sum.stretch / sum.weight);
    result.translation() = 2.0 * shift.vec();
    return result;
  }

  const std::vector<Affine>& moves_;
  std::vector<Quat> turns_;      ///< Of dual quaternions; empty: blending is linear.
  std::vector<Mat3> stretches_;  ///< What joints do before they turn.
};

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

// Normals become those of corners, each moved as `moved` says of its point.
template <class Move>
void move_normals(MeshSources& sources, std::size_t points, const Move& moved) {
  if (!sources.normals) return;
  const CornerData& data = *sources.normals;
  CornerData result;
  result.width = 3;
  result.interpolation = Interpolation::FaceVarying;
  std::vector<float>& numbers = result.values.converted;
  numbers.reserve(3 * sources.indices.span.size());
  std::size_t corner = 0;
  for (std::size_t face = 0; face < sources.counts.span.size(); ++face) {
    for (std::int32_t k = 0; k < sources.counts.span[face]; ++k, ++corner) {
      if (corner >= sources.indices.span.size()) break;
      const std::int32_t index = sources.indices.span[corner];
      const auto point = static_cast<std::size_t>(index);
      const bool exists = index >= 0 && point < points;
      const float* said = exists ? data.at(face, point, corner) : nullptr;
      Vec3 normal = said ? Vec3(said[0], said[1], said[2]) : Vec3::Zero();
      if (exists) normal = moved(point, normal);
      for (int axis = 0; axis < 3; ++axis) numbers.push_back(static_cast<float>(normal[axis]));
    }
  }
  numbers.resize(3 * sources.indices.span.size(), 0.0f);
  result.values.span = numbers;
  sources.normals = std::move(result);
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
  const Prim* at = &prim;
  while (at && at->type_name != "SkelRoot") at = at->parent;
  if (!at) return false;
  return stage_.has_property(prim, "skel:blendShapes") ||
         stage_.has_property(owner_of(prim, "primvars:skel:jointIndices"),
                             "primvars:skel:jointIndices");
}

/// The prim that says a property of a binding: it holds for all below.
const Prim& Skinning::owner_of(const Prim& prim, const char* name) {
  for (const Prim* at = &prim; at; at = at->parent) {
    if (stage_.has_property(*at, name)) return *at;
    if (at->type_name == "SkelRoot") break;
  }
  return prim;
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

/// The shape itself and those in between, by their weights, from nothing at 0 on.
std::vector<Skinning::SubShape> Skinning::sub_shapes(const Prim& shape, std::size_t offsets,
                                                     Losses& losses) const {
  std::vector<SubShape> shapes{{0.0, ""}, {1.0, "offsets"}};
  for (const std::string& name : stage_.property_names(shape, "inbetweens:")) {
    // inbetweens:half:normalOffsets is about the normals of inbetweens:half.
    if (name.find(':', std::string_view("inbetweens:").size()) != std::string::npos) continue;
    const double weight = stage_.property_metadata(shape, name, "weight").as_number().value_or(NAN);
    const auto found = usd::numbers<float>(stage_.value(shape, name), 3);
    const bool is_sound = std::isfinite(weight) && weight != 0.0 && weight != 1.0 && found &&
                          found->span.size() == offsets && shapes.size() < kMaxShapes;
    if (is_sound) {
      shapes.push_back({weight, name});
    } else {
      losses.insert(
          "has a shape in between that has no weight of its own or other points, which "
          "is left out");
    }
  }
  std::ranges::stable_sort(shapes, {}, &SubShape::weight);
  return shapes;
}

/// Runs straight from sub-shape to sub-shape, and on beyond the outer ones.
Skinning::Offsets Skinning::offsets_at(const Prim& shape, double weight, Losses& losses) const {
  Offsets sum;
  const auto whole = usd::numbers<float>(stage_.value(shape, "offsets"), 3);
  if (!whole) return sum;
  const std::size_t count = whole->span.size();
  const std::vector<SubShape> shapes = sub_shapes(shape, count, losses);
  const auto later = std::ranges::upper_bound(shapes, weight, {}, &SubShape::weight);
  const auto after = std::clamp(later, shapes.begin() + 1, shapes.end() - 1);
  const SubShape& high = *after;
  const SubShape& low = *(after - 1);
  const double length = high.weight - low.weight;
  const double share = length > 0.0 ? (weight - low.weight) / length : 1.0;
  sum.of_points.assign(count, 0.0);
  sum.of_normals.assign(count, 0.0);
  const auto add = [&](const std::string& name, double part, std::vector<double>& list) {
    const auto numbers = usd::numbers<float>(stage_.value(shape, name), 3);
    if (!numbers || numbers->span.size() != count) return false;
    for (std::size_t i = 0; i < count; ++i) list[i] += part * double(numbers->span[i]);
    return true;
  };
  for (const auto& [sub, part] : {std::pair(&low, 1.0 - share), std::pair(&high, share)}) {
    if (sub->name.empty() || part == 0.0) continue;
    add(sub->name, part, sum.of_points);
    const std::string normals =
        sub->name == "offsets" ? "normalOffsets" : sub->name + ":normalOffsets";
    if (!add(normals, part, sum.of_normals)) sum.has_normals = false;
  }
  return sum;
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
  std::vector<Vec3> turned(points.size(), Vec3::Zero());
  bool is_moved = false;
  bool have_normals = true;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto weight = animation.weights.find(names[i]);
    const Prim* shape = stage_.find(targets[i]);
    if (weight == animation.weights.end() || weight->second == 0.0 || !shape) continue;
    const Offsets offsets = offsets_at(*shape, weight->second, losses);
    const auto where = usd::numbers<std::int32_t>(stage_.value(*shape, "pointIndices"), 1);
    const std::size_t count = offsets.of_points.size() / 3;
    if (count == 0) continue;
    const bool has_places = where && !where->span.empty();
    if (has_places ? where->span.size() != count : count != points.size()) {
      losses.insert("has a blend shape of another number of points, which is left out");
      continue;
    }
    const auto vector = [](const std::vector<double>& list, std::size_t k) {
      return Vec3(list[3 * k], list[3 * k + 1], list[3 * k + 2]);
    };
    for (std::size_t k = 0; k < count; ++k) {
      const std::int64_t point = has_places ? where->span[k] : static_cast<std::int64_t>(k);
      const Vec3 offset = vector(offsets.of_points, k);
      if (point < 0 || point >= static_cast<std::int64_t>(points.size()) || !offset.allFinite()) {
        losses.insert("has a blend shape of points that do not exist");
        continue;
      }
      points[static_cast<std::size_t>(point)] += offset;
      const Vec3 turn = vector(offsets.of_normals, k);
      if (turn.allFinite()) turned[static_cast<std::size_t>(point)] += turn;
    }
    is_moved = true;
    have_normals = have_normals && offsets.has_normals;
  }
  if (!is_moved) return;
  if (have_normals) {
    move_normals(sources, points.size(), [&](std::size_t point, const Vec3& normal) {
      return Vec3(normal + turned[point]);
    });
    return;
  }
  // Those that were said are of another shape; the mean ones of the faces are right.
  sources.is_smooth = sources.is_smooth || sources.normals.has_value();
  sources.normals.reset();
}

void Skinning::apply(const Prim& prim, MeshSources& sources, Losses& losses) {
  const std::size_t count = sources.points.span.size() / 3;
  sources.points_at_rest.assign(sources.points.span.begin(), sources.points.span.end());
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

  const auto bound_value = [&](const char* name) {
    return stage_.value(owner_of(prim, name), name);
  };
  const char* const indices = "primvars:skel:jointIndices";
  const auto joints = usd::numbers<std::int32_t>(bound_value(indices), 1);
  const auto weights = usd::numbers<float>(bound_value("primvars:skel:jointWeights"), 1);
  if (!joints || !weights || joints->span.empty()) return;
  const Prim& speaker = owner_of(prim, indices);
  const usd::Value said = stage_.property_metadata(speaker, indices, "interpolation");
  const bool is_rigid = !said.as_text() || *said.as_text() == "constant";
  const double each = stage_.property_metadata(speaker, indices, "elementSize")
                          .as_number()
                          .value_or(is_rigid ? static_cast<double>(joints->span.size()) : 1.0);
  const auto influences = each >= 1.0 && each <= double(kMaxInfluences) ? std::size_t(each) : 0;
  if (influences == 0 || joints->span.size() != weights->span.size() ||
      joints->span.size() != influences * (is_rigid ? 1 : count)) {
    losses.insert("has influences of joints that do not fit its points; it stays as it is bound");
    return;
  }
  // The mesh may have an order of its own.
  const usd::Strings own = texts(bound_value("skel:joints"));
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
  if (bound_value("primvars:skel:geomBindTransform").read(numbers)) geom_bind.m = numbers;
  const Affine skeleton_from_mesh = to_affine(geom_bind);
  // Bent in the skeleton's space, drawn in the mesh's.
  const Affine mesh_from_skeleton = to_affine(geometry_.world_from_prim(prim)).inverse() *
                                    to_affine(geometry_.world_from_prim(*bound));
  if (!mesh_from_skeleton.matrix().allFinite() || !skeleton_from_mesh.matrix().allFinite()) {
    losses.insert("is bound to a skeleton in a space without a size; it stays as it is bound");
    return;
  }
  const usd::Value method = bound_value("primvars:skel:skinningMethod");
  const bool is_dual = method.as_text() && *method.as_text() == "dualQuaternion";
  const JointMoves joint_moves(bones->skeleton_from_bound, is_dual);
  bool is_sound = true;
  std::vector<Mat3> turns(count);
  Affine moved = Affine::Identity();
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = is_rigid ? 0 : influences * i;
    if (!is_rigid || i == 0) {
      moved = mesh_from_skeleton *
              joint_moves.blend(joints->span.data() + first, weights->span.data() + first,
                                influences, places, is_sound) *
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
  move_normals(sources, count,
               [&](std::size_t point, const Vec3& normal) { return Vec3(turns[point] * normal); });
}

}  // namespace diorama::loader_usd
