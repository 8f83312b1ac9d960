// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <BulletCollision/CollisionDispatch/btConvexConcaveCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btConvexConvexAlgorithm.h>
#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <vector>

namespace diorama {

/// What is found where a convex shape meets the triangles of a mesh, in one step. A pair of bodies
/// keeps four contacts; Bullet lets every triangle replace one of them, so that on a fine mesh the
/// last ones are what a body stands on, wherever they are. Here those are kept that span the most.
class MeshContacts {
 public:
  struct Contact {
    btVector3 normal;  ///< World, of the second body of the result.
    btVector3 place;   ///< World, on that body.
    btScalar distance;
    btScalar facing;  ///< Cosine between the contact's normal and the triangle's, without its sign.
    int part;
    int triangle;
  };

  /// Before the triangles of the next pair.
  void begin();
  /// Whether the next triangle that lies near the shape is searched for contacts. Of a fine mesh
  /// deep in a hull there are thousands, at several microseconds each: all of the first 128 are, of
  /// the next 128 every second, of the next 256 every fourth, and so on. Meshes give neighbours one
  /// after the other, so what is left out has others beside it.
  bool takes_next_triangle();
  void add(const Contact& contact) { found_.push_back(contact); }
  std::size_t count() const { return found_.size(); }
  /// The best of what was found and of what the manifold has kept, as its contacts. What is found
  /// where one was has its impulses.
  void write(btManifoldResult& result, bool is_mesh_first) const;

 private:
  std::uint32_t triangles_ = 0;
  std::vector<Contact> found_;
};

/// Bullet's collision algorithms, but for convex shapes on the triangles of a mesh: triangles that
/// lie farther away than contacts reach are left out before Bullet searches for the distance. It
/// would do so for each whose box along the world's axes meets the shape's, and up to four times
/// where there are few contacts (setConvexConvexMultipointIterations()).
class MeshCollisionConfiguration final : public btDefaultCollisionConfiguration {
 public:
  explicit MeshCollisionConfiguration(const btDefaultCollisionConstructionInfo& info);

  btCollisionAlgorithmCreateFunc* getCollisionAlgorithmCreateFunc(int first_type,
                                                                  int second_type) override;

 private:
  struct OnTriangle final : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(
        btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* convex,
        const btCollisionObjectWrapper* triangle) override;
    const btConvexConvexAlgorithm::CreateFunc* usual = nullptr;
    MeshContacts* contacts = nullptr;
  };
  struct OnMesh final : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper* first,
                                                   const btCollisionObjectWrapper* second) override;
    bool is_mesh_first = false;
    MeshContacts* contacts = nullptr;
  };
  MeshContacts contacts_;
  OnTriangle on_triangle_;
  OnMesh on_mesh_;
  OnMesh mesh_on_;
};

}  // namespace diorama
