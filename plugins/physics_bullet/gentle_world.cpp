// SPDX-License-Identifier: Apache-2.0
#include "gentle_world.h"

#include <algorithm>
#include <optional>

#include "shape_cache.h"

namespace diorama {
namespace {

/// Shows a body as convex while Bullet decides whether to sweep it. The sweep itself uses a sphere,
/// never the shape.
class ConvexDisguise {
 public:
  ConvexDisguise(btRigidBody& body, btCollisionShape& stand_in)
      : body_(body), shape_(body.getCollisionShape()) {
    if (shape_->isCompound()) body_.setCollisionShape(&stand_in);
  }
  ~ConvexDisguise() {
    if (shape_->isCompound()) body_.setCollisionShape(shape_);
  }
  ConvexDisguise(const ConvexDisguise&) = delete;
  ConvexDisguise& operator=(const ConvexDisguise&) = delete;

 private:
  btRigidBody& body_;
  btCollisionShape* shape_;
};

/// A contact between a moving body and a triangle, seen from the body.
struct TriangleContact {
  const btCollisionObject* body = nullptr;
  const btCollisionObject* fixed = nullptr;
  const StaticMesh* mesh = nullptr;  ///< Null for contacts of other kinds.
  int triangle = -1;
  bool is_fixed_second = true;
  int part = -1;      ///< Which child of a compound body touches.
  btVector3 push;     ///< Direction in which the contact pushes the body.
  btVector3 touched;  ///< Point of the triangle, world.
};

TriangleContact triangle_contact(const btPersistentManifold& manifold,
                                 const btManifoldPoint& contact) {
  const btCollisionObject* a = manifold.getBody0();
  const btCollisionObject* b = manifold.getBody1();
  const auto* mesh_a = static_cast<const StaticMesh*>(a->getUserPointer());
  const auto* mesh_b = static_cast<const StaticMesh*>(b->getUserPointer());
  if (mesh_b && contact.m_index1 >= 0) {
    return {a,
            b,
            mesh_b,
            contact.m_index1,
            true,
            contact.m_index0,
            contact.m_normalWorldOnB,
            contact.m_positionWorldOnB};
  }
  if (mesh_a && contact.m_index0 >= 0) {
    return {b,
            a,
            mesh_a,
            contact.m_index0,
            false,
            contact.m_index1,
            -contact.m_normalWorldOnB,
            contact.m_positionWorldOnA};
  }
  return {};
}

struct WorldTriangle {
  btVector3 corners[3];
  btVector3 normal;
};

WorldTriangle world_triangle(const TriangleContact& contact) {
  WorldTriangle triangle;
  const auto& indices = contact.mesh->triangles[std::size_t(contact.triangle)];
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3f& p = contact.mesh->positions[indices[i]];
    triangle.corners[i] = contact.fixed->getWorldTransform() * btVector3(p.x(), p.y(), p.z());
  }
  const btVector3 along = triangle.corners[1] - triangle.corners[0];
  triangle.normal = along.cross(triangle.corners[2] - triangle.corners[0]).normalized();
  return triangle;
}

/// Whether the touched point lies at an edge where a body may leave the triangle sideways.
bool is_at_open_edge(const TriangleContact& contact, const WorldTriangle& triangle,
                     bool from_front) {
  constexpr double kNear = 1e-3;  // metres, and share of the triangle's height over the edge
  const InnerEdges edges = contact.mesh->inner_edges[std::size_t(contact.triangle)];
  for (int i = 0; i < 3; ++i) {
    const btVector3& start = triangle.corners[i];
    const btVector3 along = (triangle.corners[(i + 1) % 3] - start).normalized();
    const btVector3 inward = triangle.normal.cross(along);
    const double height = inward.dot(triangle.corners[(i + 2) % 3] - start);
    const double inside = inward.dot(contact.touched - start);
    if (inside < std::max(kNear * height, std::min(kNear, 0.1 * height)) &&
        !edges.is_inner(i, from_front)) {
      return true;
    }
  }
  return false;
}

/// Away from the triangle, to the side where the body's centre of mass is.
btVector3 outward_of(const TriangleContact& seen, const WorldTriangle& triangle) {
  const btVector3 to_centre = seen.body->getWorldTransform().getOrigin() - triangle.corners[0];
  return triangle.normal.dot(to_centre) >= 0.0 ? triangle.normal : -triangle.normal;
}

/// The farthest point of the touching convex shape, world; nothing for an unknown part.
std::optional<btVector3> support_point(const TriangleContact& seen, const btVector3& direction) {
  const btCollisionShape* shape = seen.body->getCollisionShape();
  btTransform place = seen.body->getWorldTransform();
  if (shape->isCompound()) {
    const auto& compound = static_cast<const btCompoundShape&>(*shape);
    if (seen.part < 0 || seen.part >= compound.getNumChildShapes()) return std::nullopt;
    place = place * compound.getChildTransform(seen.part);
    shape = compound.getChildShape(seen.part);
  }
  const auto& convex = static_cast<const btConvexShape&>(*shape);
  return place * convex.localGetSupportingVertex(place.getBasis().transpose() * direction);
}

bool projects_inside(const WorldTriangle& triangle, const btVector3& point) {
  for (int i = 0; i < 3; ++i) {
    const btVector3 along = triangle.corners[(i + 1) % 3] - triangle.corners[i];
    if (triangle.normal.cross(along).dot(point - triangle.corners[i]) < 0.0) return false;
  }
  return true;
}

/// Writes the contact anew.
void set_contact(const TriangleContact& seen, const btVector3& on_body, const btVector3& push,
                 double distance, btManifoldPoint& contact) {
  const btVector3 on_triangle = on_body - push * distance;
  const btVector3 body_local = seen.body->getWorldTransform().invXform(on_body);
  const btVector3 fixed_local = seen.fixed->getWorldTransform().invXform(on_triangle);
  contact.setDistance(distance);
  if (seen.is_fixed_second) {
    contact.m_normalWorldOnB = push;
    contact.m_positionWorldOnA = on_body;
    contact.m_positionWorldOnB = on_triangle;
    contact.m_localPointA = body_local;
    contact.m_localPointB = fixed_local;
  } else {
    contact.m_normalWorldOnB = -push;
    contact.m_positionWorldOnA = on_triangle;
    contact.m_positionWorldOnB = on_body;
    contact.m_localPointA = fixed_local;
    contact.m_localPointB = body_local;
  }
}

enum class Verdict { Keep, Remove, Rebuild };

/// What to do with a contact; turns it to the right side where that is enough.
Verdict mend_direction(const TriangleContact& seen, btManifoldPoint& contact) {
  const WorldTriangle triangle = world_triangle(seen);
  const btVector3 outward = outward_of(seen, triangle);
  const double agreement = outward.dot(seen.push);
  // Where only the skins overlap, Bullet's contact is exact.
  const bool is_deep = contact.getDistance() < -2.0 * seen.mesh->shape->getMargin();
  if (agreement > 0.99 && !is_deep) return Verdict::Keep;
  const bool from_front = outward.dot(triangle.normal) > 0.0;
  if (is_at_open_edge(seen, triangle, from_front)) {
    return agreement > -0.1 ? Verdict::Keep : Verdict::Remove;
  }
  if (is_deep) return Verdict::Rebuild;
  const btVector3 on_body =
      seen.is_fixed_second ? contact.m_positionWorldOnA : contact.m_positionWorldOnB;
  set_contact(seen, on_body, outward, contact.getDistance(), contact);
  return Verdict::Keep;
}

/// Up to four points of the body under the triangle, the deepest one and those found in directions
/// that lean to three sides: a foot to stand on, where the search for the way out finds one point
/// and often a poor one.
int rebuild_contacts(const btManifoldPoint& poor, btPersistentManifold& manifold) {
  constexpr double kLean = 0.4;
  const TriangleContact seen = triangle_contact(manifold, poor);
  const WorldTriangle triangle = world_triangle(seen);
  const btVector3 outward = outward_of(seen, triangle);
  btVector3 side, unused;
  btPlaneSpace1(outward, side, unused);
  int added = 0;
  for (int i = 0; i < 4 && manifold.getNumContacts() < MANIFOLD_CACHE_SIZE; ++i) {
    const btVector3 lean =
        i == 0 ? btVector3(0, 0, 0) : side.rotate(outward, btScalar(2.0 * SIMD_PI / 3.0 * i));
    const auto point = support_point(seen, kLean * lean - outward);
    if (!point || !projects_inside(triangle, *point)) continue;
    const double depth = outward.dot(*point - triangle.corners[0]) - seen.mesh->shape->getMargin();
    if (depth > 0.0) continue;
    btManifoldPoint contact = poor;
    contact.m_appliedImpulse = contact.m_appliedImpulseLateral1 = 0.0;
    contact.m_appliedImpulseLateral2 = contact.m_prevRHS = 0.0;
    set_contact(seen, *point, outward, depth, contact);
    manifold.addManifoldPoint(contact);
    ++added;
  }
  return added;
}

/// The contact turned to the right side, not deeper than the body reaches under the triangle.
void turn_deep_contact(btManifoldPoint contact, btPersistentManifold& manifold) {
  const TriangleContact seen = triangle_contact(manifold, contact);
  const WorldTriangle triangle = world_triangle(seen);
  const btVector3 outward = outward_of(seen, triangle);
  const auto deepest = support_point(seen, -outward);
  double depth = contact.getDistance();
  if (deepest) depth = std::max(depth, double(outward.dot(*deepest - triangle.corners[0])));
  const btVector3 on_body =
      seen.is_fixed_second ? contact.m_positionWorldOnA : contact.m_positionWorldOnB;
  set_contact(seen, on_body, outward, depth, contact);
  manifold.addManifoldPoint(contact);
}

}  // namespace

GentleWorld::GentleWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
                         btConstraintSolver* solver, btCollisionConfiguration* configuration,
                         double max_depenetration_speed)
    : btDiscreteDynamicsWorld(dispatcher, broadphase, solver, configuration),
      max_depenetration_speed_(max_depenetration_speed) {}

void GentleWorld::mend_contacts(btPersistentManifold& manifold, double lowest_distance) {
  rebuilt_.clear();
  for (int i = manifold.getNumContacts() - 1; i >= 0; --i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    const TriangleContact seen = triangle_contact(manifold, contact);
    if (!seen.mesh) continue;
    const Verdict verdict = mend_direction(seen, contact);
    if (verdict == Verdict::Keep) continue;
    const bool is_known = std::any_of(rebuilt_.begin(), rebuilt_.end(), [&](const auto& other) {
      return other.m_index0 == contact.m_index0 && other.m_index1 == contact.m_index1;
    });
    if (verdict == Verdict::Rebuild && !is_known) rebuilt_.push_back(contact);
    manifold.removeContactPoint(i);
  }
  int added = 0;
  for (const btManifoldPoint& poor : rebuilt_) added += rebuild_contacts(poor, manifold);
  if (added == 0 && !rebuilt_.empty()) turn_deep_contact(rebuilt_.front(), manifold);
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    contact.setDistance(std::max(contact.getDistance(), lowest_distance));
  }
}

void GentleWorld::solveConstraints(btContactSolverInfo& info) {
  // The solver undoes the share erp2 of a depth per step. Contact detection writes the distances
  // anew before the next step.
  const double lowest = -max_depenetration_speed_ * info.m_timeStep / info.m_erp2;
  btDispatcher& dispatcher = *getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    mend_contacts(*dispatcher.getManifoldByIndexInternal(i), lowest);
  }
  btDiscreteDynamicsWorld::solveConstraints(info);
}

void GentleWorld::createPredictiveContacts(btScalar seconds) {
  releasePredictiveContacts();
  for (int i = 0; i < m_nonStaticRigidBodies.size(); ++i) {
    const ConvexDisguise disguise(*m_nonStaticRigidBodies[i], stand_in_);
    createPredictiveContactsInternal(&m_nonStaticRigidBodies[i], 1, seconds);
  }
}

void GentleWorld::integrateTransforms(btScalar seconds) {
  for (int i = 0; i < m_nonStaticRigidBodies.size(); ++i) {
    const ConvexDisguise disguise(*m_nonStaticRigidBodies[i], stand_in_);
    integrateTransformsInternal(&m_nonStaticRigidBodies[i], 1, seconds);
  }
}

}  // namespace diorama
