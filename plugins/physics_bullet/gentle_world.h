// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletDynamicsCommon.h>

namespace diorama {

/// A Bullet world that pushes overlapping bodies apart slowly: whatever the depth, the correction
/// is that of the depth which the given speed undoes, and it leaves no velocity behind.
class GentleWorld final : public btDiscreteDynamicsWorld {
 public:
  GentleWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
              btConstraintSolver* solver, btCollisionConfiguration* configuration,
              double max_depenetration_speed);

 protected:
  void solveConstraints(btContactSolverInfo& info) override;

 private:
  double max_depenetration_speed_;
};

}  // namespace diorama
