// SPDX-License-Identifier: Apache-2.0
#include "collision_world.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "diorama/obstacles.h"

namespace diorama {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;
using Object = fcl::CollisionObjectd;

/// One mesh in the world's axes, at its place when it was read. Most meshes of a room are never
/// near to what is placed, so what FCL needs is made when it is first asked for.
class Part {
 public:
  Part(const Scene& scene, NodeId node)
      : mesh_(scene[node].mesh),
        world_from_mesh_(scene.world_from_node(node)),
        triangles_(scene, std::span(&node, 1), Obstacles::Hidden::Count) {
    for (const auto& triangle : mesh_->triangles) {
      for (const std::uint32_t corner : triangle) box_world_.add(point(corner));
    }
  }

  const Aabb& box_world() const { return box_world_; }
  bool reaches_into(const Aabb& box_world) const {
    return triangles_.meets_box(box_world, Affine::Identity());
  }
  const std::shared_ptr<Model>& model() const {
    if (!model_) model_ = make_model();
    return model_;
  }
  /// Three per triangle.
  const std::vector<Vec3>& corners_world() const {
    if (corners_world_.empty()) {
      for (const auto& triangle : mesh_->triangles) {
        for (const std::uint32_t corner : triangle) corners_world_.push_back(point(corner));
      }
    }
    return corners_world_;
  }

 private:
  Vec3 point(std::uint32_t index) const {
    return world_from_mesh_ * mesh_->positions[index].cast<double>();
  }
  std::shared_ptr<Model> make_model() const {
    std::vector<Vec3> points;
    points.reserve(mesh_->positions.size());
    for (std::uint32_t i = 0; i < mesh_->positions.size(); ++i) points.push_back(point(i));
    std::vector<fcl::Triangle> triangles;
    triangles.reserve(mesh_->triangles.size());
    for (const auto& [a, b, c] : mesh_->triangles) triangles.emplace_back(a, b, c);
    auto model = std::make_shared<Model>();
    model->beginModel(int(triangles.size()), int(points.size()));
    model->addSubModel(points, triangles);
    model->endModel();
    return model;
  }

  std::shared_ptr<const Mesh> mesh_;
  Affine world_from_mesh_;
  Obstacles triangles_;
  Aabb box_world_;
  mutable std::shared_ptr<Model> model_;
  mutable std::vector<Vec3> corners_world_;
};

bool holds(const Aabb& outer, const Aabb& inner) {
  return (outer.min.array() <= inner.min.array()).all() &&
         (outer.max.array() >= inner.max.array()).all();
}

Aabb shifted(const Aabb& box, const Vec3& shift) { return {box.min + shift, box.max + shift}; }

/// Winding number from which on a point counts as enclosed: from the bottom of an open box it is
/// still far below.
constexpr double kClosed = 0.999;

/// Signed solid angle of the mesh seen from the point, over a whole turn: 1 (or -1) inside a closed
/// mesh, 0 outside. Van Oosterom and Strackee 1983.
double winding_number(const std::vector<Vec3>& corners, const Vec3& point) {
  double sum = 0.0;
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    const Vec3 a = corners[i] - point;
    const Vec3 b = corners[i + 1] - point;
    const Vec3 c = corners[i + 2] - point;
    const double volume = a.dot(b.cross(c));
    const double scale = a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                         b.dot(c) * a.norm() + c.dot(a) * b.norm();
    sum += 2.0 * std::atan2(volume, scale);
  }
  return sum / (4.0 * kPi);
}

/// A part and how far it was moved.
struct Placed {
  const Part& part;
  const Vec3& shift;

  Aabb box() const { return shifted(part.box_world(), shift); }
  /// Whether a triangle may be met by something in the box.
  bool reaches_into(const Aabb& box_world) const {
    return part.reaches_into(shifted(box_world, -shift));
  }
  bool encloses(const Placed& other) const {
    if (!holds(box(), other.box())) return false;
    const Vec3 point = other.part.corners_world().front() + other.shift - shift;
    return std::abs(winding_number(part.corners_world(), point)) > kClosed;
  }
};

bool overlaps(const Aabb& a, const Aabb& b) {
  return (a.min.array() <= b.max.array()).all() && (a.max.array() >= b.min.array()).all();
}

bool meet(const Placed& one, const Placed& two) {
  if (!overlaps(one.box(), two.box())) return false;
  if (one.reaches_into(two.box()) && two.reaches_into(one.box())) {
    const Object a(one.part.model(), Mat3::Identity(), one.shift);
    const Object b(two.part.model(), Mat3::Identity(), two.shift);
    fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    if (fcl::collide(&a, &b, request, result) > 0) return true;
  }
  return one.encloses(two) || two.encloses(one);
}

}  // namespace

struct CollisionBody::Parts {
  std::vector<Part> all;
  Aabb bounds_world;
};

CollisionBody::CollisionBody(const Scene& scene, NodeId node) : parts_(std::make_unique<Parts>()) {
  for (const NodeId below : scene.subtree(node)) {
    const auto& mesh = scene[below].mesh;
    if (!mesh || mesh->triangles.empty()) continue;
    parts_->all.emplace_back(scene, below);
    parts_->bounds_world.add(parts_->all.back().box_world());
  }
}

CollisionBody::~CollisionBody() = default;
CollisionBody::CollisionBody(CollisionBody&&) noexcept = default;
CollisionBody& CollisionBody::operator=(CollisionBody&&) noexcept = default;

bool CollisionBody::has_shape() const { return !parts_->all.empty(); }
const Aabb& CollisionBody::bounds_world() const { return parts_->bounds_world; }

struct CollisionWorld::State {
  struct Standing {
    CollisionBody body;
    Vec3 shift;
  };
  std::vector<Standing> standing;
};

CollisionWorld::CollisionWorld() : state_(std::make_unique<State>()) {}
CollisionWorld::~CollisionWorld() = default;

void CollisionWorld::add(CollisionBody body, const Vec3& shift) {
  state_->standing.push_back({std::move(body), shift});
}

bool CollisionWorld::is_free(const CollisionBody& body, const Vec3& shift) const {
  for (const State::Standing& standing : state_->standing) {
    for (const Part& other : standing.body.parts_->all) {
      for (const Part& part : body.parts_->all) {
        if (meet({other, standing.shift}, {part, shift})) return false;
      }
    }
  }
  return true;
}

}  // namespace diorama
