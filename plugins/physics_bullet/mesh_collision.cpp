// SPDX-License-Identifier: Apache-2.0
#include "mesh_collision.h"

#include <BulletCollision/CollisionShapes/btTriangleShape.h>

#include <algorithm>
#include <array>
#include <new>

namespace diorama {
namespace {

/// Whether the triangle is farther from the shape than `reach`, as far as four axes tell: those of
/// the shape, and that from its middle to the triangle's. They leave out two triangles of three
/// that Bullet looks at (measured: things in plates and bowls); the triangle's normal none.
bool is_apart(const btCollisionObjectWrapper& convex, const btCollisionObjectWrapper& triangle,
              double reach) {
  const auto& shape = static_cast<const btConvexShape&>(*convex.getCollisionShape());
  const auto& corners = static_cast<const btTriangleShape&>(*triangle.getCollisionShape());
  btVector3 low;
  btVector3 high;
  shape.getAabb(btTransform::getIdentity(), low, high);
  const btTransform shape_from_triangle =
      convex.getWorldTransform().inverseTimes(triangle.getWorldTransform());
  std::array<btVector3, 3> p;
  for (int i = 0; i < 3; ++i) {
    p[std::size_t(i)] = shape_from_triangle * corners.getVertexPtr(i);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const auto [least, most] = std::minmax({p[0][axis], p[1][axis], p[2][axis]});
    if (least > high[axis] + reach || most < low[axis] - reach) return true;
  }
  btVector3 way = (p[0] + p[1] + p[2]) / 3.0 - 0.5 * (low + high);
  const double length = way.length();
  if (!(length > 0.0)) return false;
  way /= length;
  const double least = std::min({way.dot(p[0]), way.dot(p[1]), way.dot(p[2])});
  return least - way.dot(shape.localGetSupportingVertex(way)) > reach;
}

class TriangleAlgorithm final : public btConvexConvexAlgorithm {
 public:
  using btConvexConvexAlgorithm::btConvexConvexAlgorithm;

  void processCollision(const btCollisionObjectWrapper* convex,
                        const btCollisionObjectWrapper* triangle, const btDispatcherInfo& info,
                        btManifoldResult* result) override {
    const double reach = convex->getCollisionShape()->getMargin() +
                         triangle->getCollisionShape()->getMargin() +
                         result->getPersistentManifold()->getContactBreakingThreshold() +
                         result->m_closestPointDistanceThreshold;
    if (is_apart(*convex, *triangle, reach)) return;
    btConvexConvexAlgorithm::processCollision(convex, triangle, info, result);
  }
};

}  // namespace

btCollisionAlgorithm* MeshCollisionConfiguration::CreateFunc::CreateCollisionAlgorithm(
    btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* convex,
    const btCollisionObjectWrapper* triangle) {
  void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(TriangleAlgorithm));
  return new (memory) TriangleAlgorithm(info.m_manifold, info, convex, triangle, usual->m_pdSolver,
                                        usual->m_numPerturbationIterations,
                                        usual->m_minimumPointsPerturbationThreshold);
}

btCollisionAlgorithmCreateFunc* MeshCollisionConfiguration::getCollisionAlgorithmCreateFunc(
    int first_type, int second_type) {
  btCollisionAlgorithmCreateFunc* const usual =
      btDefaultCollisionConfiguration::getCollisionAlgorithmCreateFunc(first_type, second_type);
  // Spheres have an algorithm of their own.
  if (second_type != TRIANGLE_SHAPE_PROXYTYPE || usual != m_convexConvexCreateFunc) return usual;
  create_.usual = static_cast<btConvexConvexAlgorithm::CreateFunc*>(usual);
  return &create_;
}

}  // namespace diorama
