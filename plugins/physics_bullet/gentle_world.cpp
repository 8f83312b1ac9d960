// SPDX-License-Identifier: Apache-2.0
#include "gentle_world.h"

#include <algorithm>

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
    return {
        a, b, mesh_b, contact.m_index1, true, contact.m_normalWorldOnB, contact.m_positionWorldOnB};
  }
  if (mesh_a && contact.m_index0 >= 0) {
    return {b,
            a,
            mesh_a,
            contact.m_index0,
            false,
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

/// Turns the contact's direction and keeps its depth and its point on the moving body.
void turn_contact(const TriangleContact& seen, const btVector3& push, btManifoldPoint& contact) {
  const btTransform& fixed = seen.fixed->getWorldTransform();
  if (seen.is_fixed_second) {
    contact.m_normalWorldOnB = push;
    contact.m_positionWorldOnB = contact.m_positionWorldOnA - push * contact.getDistance();
    contact.m_localPointB = fixed.invXform(contact.m_positionWorldOnB);
  } else {
    contact.m_normalWorldOnB = -push;
    contact.m_positionWorldOnA = contact.m_positionWorldOnB - push * contact.getDistance();
    contact.m_localPointA = fixed.invXform(contact.m_positionWorldOnA);
  }
}

/// Makes the triangle push to the right side. False when the contact must go.
bool mend_direction(const TriangleContact& seen, btManifoldPoint& contact) {
  const WorldTriangle triangle = world_triangle(seen);
  const btVector3 to_centre = seen.body->getWorldTransform().getOrigin() - triangle.corners[0];
  const bool from_front = triangle.normal.dot(to_centre) >= 0.0;
  const btVector3 outward = from_front ? triangle.normal : -triangle.normal;
  const double agreement = outward.dot(seen.push);
  if (agreement > 0.99) return true;
  if (is_at_open_edge(seen, triangle, from_front)) return agreement > -0.1;
  turn_contact(seen, outward, contact);
  return true;
}

}  // namespace

GentleWorld::GentleWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
                         btConstraintSolver* solver, btCollisionConfiguration* configuration,
                         double max_depenetration_speed)
    : btDiscreteDynamicsWorld(dispatcher, broadphase, solver, configuration),
      max_depenetration_speed_(max_depenetration_speed) {}

void GentleWorld::mend_contacts(btPersistentManifold& manifold, double lowest_distance) {
  for (int i = manifold.getNumContacts() - 1; i >= 0; --i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    const TriangleContact seen = triangle_contact(manifold, contact);
    if (seen.mesh && !mend_direction(seen, contact)) {
      manifold.removeContactPoint(i);
    } else {
      contact.setDistance(std::max(contact.getDistance(), lowest_distance));
    }
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
