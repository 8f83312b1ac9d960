// SPDX-License-Identifier: Apache-2.0
#include "carrier.h"

#include <utility>

#include "rigid_stretch.h"

namespace diorama {

btRigidBody& Carrier::make_movable(StaticObject& fixed) {
  btCollisionObject& old = *fixed.object;
  if (btRigidBody* const body = btRigidBody::upcast(&old)) return *body;
  btRigidBody::btRigidBodyConstructionInfo info(0.0, nullptr, old.getCollisionShape());
  info.m_startWorldTransform = old.getWorldTransform();
  info.m_friction = old.getFriction();
  info.m_restitution = old.getRestitution();
  auto body = std::make_unique<btRigidBody>(info);
  // Without mass it is static as well, and stays so to the world's contacts.
  body->setCollisionFlags(body->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
  body->setUserPointer(old.getUserPointer());
  body->setUserIndex(old.getUserIndex());
  world_.removeCollisionObject(&old);
  world_.addRigidBody(body.get(), kStaticGroup, kStaticMask);
  btRigidBody& made = *body;
  replaced_.push_back(std::exchange(fixed.object, std::move(body)));
  return made;
}

void Carrier::stop() {
  for (const Way& way : ways_) {
    way.body->setWorldTransform(way.end);
    way.body->setInterpolationWorldTransform(way.end);
    way.body->setLinearVelocity(btVector3(0.0, 0.0, 0.0));
    way.body->setAngularVelocity(btVector3(0.0, 0.0, 0.0));
    way.body->forceActivationState(ISLAND_SLEEPING);
  }
  ways_.clear();
}

void Carrier::aim(const Scene& scene, double seconds, std::vector<StaticObject>& statics) {
  stop();
  whole_s_ = seconds;
  gone_s_ = 0.0;
  for (StaticObject& fixed : statics) {
    if (!scene.contains(fixed.node)) continue;
    const Affine world_from_node = scene.world_from_node(fixed.node);
    if (world_from_node.matrix() == fixed.world_from_node.matrix()) continue;
    fixed.world_from_node = world_from_node;
    const Rigid place = split_rigid(world_from_node).rigid * fixed.node_from_object;
    btRigidBody& body = make_movable(fixed);
    // What moves wakes what it touches.
    body.forceActivationState(DISABLE_DEACTIVATION);
    const btTransform& now = body.getWorldTransform();
    ways_.push_back({&body, now, bullet_transform(place), now});
  }
}

void Carrier::begin_step(double seconds) {
  if (ways_.empty()) return;
  if (gone_s_ >= whole_s_) return stop();
  gone_s_ += seconds;
  // The lengths of steps add up to the whole but for rounding.
  if (gone_s_ >= whole_s_ - 1e-6 * seconds) gone_s_ = whole_s_;
  const double share = gone_s_ / whole_s_;
  for (Way& way : ways_) {
    way.next = way.end;
    if (share < 1.0) {
      way.next.setOrigin(way.begin.getOrigin().lerp(way.end.getOrigin(), share));
      way.next.setRotation(way.begin.getRotation().slerp(way.end.getRotation(), share));
    }
    // The world takes the velocity of such a body from where it was a step ago.
    const btTransform& now = way.body->getWorldTransform();
    const btTransform ago(now.getBasis() * way.next.getBasis().transpose() * now.getBasis(),
                          2.0 * now.getOrigin() - way.next.getOrigin());
    way.body->setInterpolationWorldTransform(ago);
  }
}

void Carrier::end_step() {
  for (const Way& way : ways_) way.body->setWorldTransform(way.next);
}

}  // namespace diorama
