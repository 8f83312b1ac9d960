// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <BulletCollision/CollisionDispatch/btConvexConvexAlgorithm.h>
#include <btBulletDynamicsCommon.h>

namespace diorama {

/// Bullet's collision algorithms, but for convex shapes on the triangles of a mesh: triangles that
/// lie farther away than contacts reach are left out before Bullet searches for the distance. It
/// would do so for each whose box along the world's axes meets the shape's, and up to four times
/// where there are few contacts (setConvexConvexMultipointIterations()).
class MeshCollisionConfiguration final : public btDefaultCollisionConfiguration {
 public:
  using btDefaultCollisionConfiguration::btDefaultCollisionConfiguration;

  btCollisionAlgorithmCreateFunc* getCollisionAlgorithmCreateFunc(int first_type,
                                                                  int second_type) override;

 private:
  struct CreateFunc final : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(
        btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* convex,
        const btCollisionObjectWrapper* triangle) override;
    const btConvexConvexAlgorithm::CreateFunc* usual = nullptr;
  };
  CreateFunc create_;
};

}  // namespace diorama
