// SPDX-License-Identifier: Apache-2.0
#include "gentle_world.h"

#include <algorithm>

namespace diorama {

GentleWorld::GentleWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
                         btConstraintSolver* solver, btCollisionConfiguration* configuration,
                         double max_depenetration_speed)
    : btDiscreteDynamicsWorld(dispatcher, broadphase, solver, configuration),
      max_depenetration_speed_(max_depenetration_speed) {}

void GentleWorld::solveConstraints(btContactSolverInfo& info) {
  // The solver undoes the share erp2 of a depth per step. Contact detection writes the distances
  // anew before the next step.
  const double lowest = -max_depenetration_speed_ * info.m_timeStep / info.m_erp2;
  btDispatcher& dispatcher = *getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      btManifoldPoint& contact = manifold.getContactPoint(k);
      contact.setDistance(std::max(contact.getDistance(), lowest));
    }
  }
  btDiscreteDynamicsWorld::solveConstraints(info);
}

}  // namespace diorama
