// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletDynamicsCommon.h>

#include <memory>
#include <vector>

#include "body_builder.h"
#include "diorama/scene.h"

namespace diorama {

/// What stands still in a world, and what it collides with: all that moves.
constexpr int kStaticGroup = btBroadphaseProxy::StaticFilter;
constexpr int kStaticMask = btBroadphaseProxy::AllFilter ^ btBroadphaseProxy::StaticFilter;

/// Moves what no rigid body holds: doors and lifts of animations, which push and are not pushed.
class Carrier {
 public:
  explicit Carrier(btDiscreteDynamicsWorld& world) : world_(world) {}

  /// Those of `statics` that the scene has elsewhere than they were last seen are on their way
  /// there for the next `seconds`; all others stand still.
  void aim(const Scene& scene, double seconds, std::vector<StaticObject>& statics);
  /// To be called before each step of the world, which takes `seconds`: gives what is on its way
  /// the velocity of this step.
  void begin_step(double seconds);
  /// To be called after it. Contacts are looked for where things stood when the step began.
  void end_step();

 private:
  struct Way {
    btRigidBody* body = nullptr;
    btTransform begin;
    btTransform end;
    btTransform next;  ///< Where it is after this step.
  };
  btRigidBody& make_movable(StaticObject& fixed);
  void stop();

  btDiscreteDynamicsWorld& world_;
  std::vector<Way> ways_;
  double whole_s_ = 0.0;
  double gone_s_ = 0.0;
  /// In whose place movable ones stand. They live on, so that no address is one of two things.
  std::vector<std::unique_ptr<btCollisionObject>> replaced_;
};

}  // namespace diorama
