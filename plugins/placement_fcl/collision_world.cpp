// SPDX-License-Identifier: Apache-2.0
#include "collision_world.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>

#include <cmath>
#include <vector>

namespace diorama {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;
using Object = fcl::CollisionObjectd;

/// One mesh in the world's axes, at its place when it was read.
struct Part {
  std::shared_ptr<Model> model;
  std::vector<Vec3> corners_world;  ///< Three per triangle.
  Aabb box_world;
};

Part part_of(const Mesh& mesh, const Affine& world_from_mesh) {
  std::vector<Vec3> points;
  points.reserve(mesh.positions.size());
  for (const Vec3f& position : mesh.positions) {
    points.push_back(world_from_mesh * position.cast<double>());
  }
  Part part;
  part.model = std::make_shared<Model>();
  part.model->beginModel(int(mesh.triangles.size()), int(points.size()));
  std::vector<fcl::Triangle> triangles;
  triangles.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    triangles.emplace_back(a, b, c);
    for (const std::uint32_t corner : {a, b, c}) {
      part.corners_world.push_back(points[corner]);
      part.box_world.add(points[corner]);
    }
  }
  part.model->addSubModel(points, triangles);
  part.model->endModel();
  return part;
}

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

bool meet(Object* one, Object* two) {
  fcl::CollisionRequestd request;
  fcl::CollisionResultd result;
  return fcl::collide(one, two, request, result) > 0;
}

/// Ends the search at the first contact.
bool stop_when_met(Object* one, Object* two, void* has_met) {
  bool& answer = *static_cast<bool*>(has_met);
  answer = answer || meet(one, two);
  return answer;
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
    parts_->all.push_back(part_of(*mesh, scene.world_from_node(below)));
    parts_->bounds_world.add(parts_->all.back().box_world);
  }
}

CollisionBody::~CollisionBody() = default;
CollisionBody::CollisionBody(CollisionBody&&) noexcept = default;
CollisionBody& CollisionBody::operator=(CollisionBody&&) noexcept = default;

bool CollisionBody::has_shape() const { return !parts_->all.empty(); }
const Aabb& CollisionBody::bounds_world() const { return parts_->bounds_world; }

struct CollisionWorld::State {
  struct Standing {
    Part part;
    Vec3 shift;
    Object object;
  };
  // The manager keeps pointers to the objects, so they must not move, and must outlive it.
  std::vector<std::unique_ptr<Standing>> standing;
  fcl::DynamicAABBTreeCollisionManagerd manager;
};

CollisionWorld::CollisionWorld() : state_(std::make_unique<State>()) {}
CollisionWorld::~CollisionWorld() = default;

void CollisionWorld::add(CollisionBody body, const Vec3& shift) {
  for (Part& part : body.parts_->all) {
    Object object(part.model, Mat3::Identity(), shift);
    state_->standing.push_back(
        std::make_unique<State::Standing>(State::Standing{std::move(part), shift, object}));
    state_->manager.registerObject(&state_->standing.back()->object);
  }
}

bool CollisionWorld::is_free(const CollisionBody& body, const Vec3& shift) const {
  for (const Part& part : body.parts_->all) {
    Object object(part.model, Mat3::Identity(), shift);
    object.computeAABB();
    bool has_met = false;
    state_->manager.collide(&object, &has_met, stop_when_met);
    if (has_met) return false;
    const Aabb box = shifted(part.box_world, shift);
    for (const auto& standing : state_->standing) {
      const Aabb other = shifted(standing->part.box_world, standing->shift);
      const auto is_inside = [](const Part& outer, const Vec3& outer_shift, const Part& inner,
                                const Vec3& inner_shift) {
        const Vec3 point = inner.corners_world.front() + inner_shift - outer_shift;
        return std::abs(winding_number(outer.corners_world, point)) > kClosed;
      };
      if (holds(other, box) && is_inside(standing->part, standing->shift, part, shift))
        return false;
      if (holds(box, other) && is_inside(part, shift, standing->part, standing->shift))
        return false;
    }
  }
  return true;
}

}  // namespace diorama
