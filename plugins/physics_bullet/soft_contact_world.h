// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletDynamicsCommon.h>

#include <array>
#include <map>
#include <vector>

namespace diorama {

/// A Bullet world that treats overlap with care:
/// - Overlapping bodies are pushed apart slowly: whatever the depth, the correction is that of the
///   depth which the given speed undoes, and it leaves no velocity behind.
/// - A triangle pushes a body out to the side from which its centre of mass came, and sideways only
///   across edges where the surface ends or falls away. Bullet looks for the shortest way out of
///   each triangle alone, which for a body that straddles a thin, finely meshed floor is down or
///   into the next one.
/// - A body deep in a box leaves it by the face that it clears soonest. Bullet's search often fails
///   for small hulls in large boxes.
/// - A lying capsule stands on both ends.
/// - Faces that have lain on others for some steps are held from the start of a step by all of the
///   last one's impulses, other contacts begin with the share that Bullet gives: with that share
///   alone, stacks creep; without it, things are pressed into each other when others fall on them.
/// - A face that lies on another one keeps its contact points, and is drawn back to where it lay on
///   them: Bullet chooses among all points of two faces anew in each step, and friction only ends
///   motion, so that stacks creep.
/// - What balances on an edge or a corner, and on nothing else, has no rolling friction. Bullet's
///   would hold it there for good.
/// - Continuous detection works for compound bodies as well; Bullet leaves them out.
///
/// Static objects of triangles must carry their StaticMesh as user pointer, all others none. The
/// user index of a moving body is its place in the order of addition. What moves without being
/// moved is a rigid body that is static and kinematic.
class SoftContactWorld final : public btDiscreteDynamicsWorld {
 public:
  SoftContactWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
                   btConstraintSolver* solver, btCollisionConfiguration* configuration,
                   double max_depenetration_speed);

 protected:
  void solveConstraints(btContactSolverInfo& info) override;
  void createPredictiveContacts(btScalar seconds) override;
  void integrateTransforms(btScalar seconds) override;

 private:
  void note_depth(const btCollisionObject& body, const btCollisionObject& fixed);
  void repair_contacts(btPersistentManifold& manifold, double lowest_distance);
  void keep_steady_impulses(btPersistentManifold& manifold);
  void hold_face(btPersistentManifold& manifold, double lowest_distance);
  void let_balance_go();
  void note_faces();

  /// Contacts of a face with another one, as a step left them.
  struct Face {
    const btCollisionObject* a = nullptr;
    const btCollisionObject* b = nullptr;
    int count = 0;
    std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> contacts;
    std::array<btVector3, MANIFOLD_CACHE_SIZE> normals;  ///< Of the contacts, in the space of b.
  };

  double max_depenetration_speed_;
  btSphereShape stand_in_{0.01};
  /// Of each moving body, its centre of mass when it was last not deep in anything fixed, seen from
  /// what it is deep in.
  std::vector<btVector3> clear_centres_;
  std::vector<bool> is_clear_;                         ///< Of each moving body in this step.
  std::vector<btVector3> drifts_;                      ///< Velocities of what they are deep in.
  std::map<const btPersistentManifold*, Face> faces_;  ///< Only ever looked up.
  // Scratch of repair_contacts.
  std::vector<btManifoldPoint> rebuilt_;
  std::vector<btManifoldPoint> candidates_;
};

}  // namespace diorama
