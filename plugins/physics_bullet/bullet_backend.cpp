// SPDX-License-Identifier: Apache-2.0
#include "bullet_backend.h"

#include <algorithm>
#include <string>

#include "body_builder.h"
#include "carrier.h"
#include "diorama/error.h"
#include "joint_builder.h"
#include "mesh_collision.h"
#include "soft_contact_world.h"

namespace diorama {
namespace {

Vec3 from_bullet(const btVector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

btVector3 to_bullet(const Vec3& vector) { return {vector.x(), vector.y(), vector.z()}; }

Rigid from_bullet(const btTransform& transform) {
  const btQuaternion rotation = transform.getRotation();
  Rigid rigid = Rigid::Identity();
  rigid.linear() =
      Quat(rotation.w(), rotation.x(), rotation.y(), rotation.z()).normalized().toRotationMatrix();
  rigid.translation() = from_bullet(transform.getOrigin());
  return rigid;
}

/// The body goes on as its node does. The scene has the velocity of the node's origin, Bullet that
/// of the centre of mass.
void set_velocities(const Scene& scene, const MovingBody& moving) {
  const RigidBody& known = *scene[moving.node].rigid_body;
  if (known.linear_velocity.isZero(0.0) && known.angular_velocity.isZero(0.0)) return;
  const Vec3 arm = from_bullet(moving.start.getOrigin()) -
                   Vec3(scene.world_from_node(moving.node).translation());
  moving.body->setLinearVelocity(
      to_bullet(known.linear_velocity + known.angular_velocity.cross(arm)));
  moving.body->setAngularVelocity(to_bullet(known.angular_velocity));
}

double outer_margin(const btCollisionObject& object, const Bodies& bodies) {
  const int index = object.getUserIndex();
  return index >= 0 ? bodies.moving[std::size_t(index)].shapes.outer_margin_m
                    : bodies.statics[std::size_t(-1 - index)].shapes.outer_margin_m;
}

/// Distance of the two touching points as the bodies stand now; contacts keep that of the last
/// detection, which the world limits.
double distance_now(const btPersistentManifold& manifold, const btManifoldPoint& contact) {
  const btVector3 a = manifold.getBody0()->getWorldTransform() * contact.m_localPointA;
  const btVector3 b = manifold.getBody1()->getWorldTransform() * contact.m_localPointB;
  return (a - b).dot(contact.m_normalWorldOnB);
}

/// Bullet sets 6 MiB aside for each world, for 4096 pairs that touch. A visit has some dozens; what
/// is beyond comes from the heap.
btDefaultCollisionConstructionInfo small_pools() {
  btDefaultCollisionConstructionInfo info;
  info.m_defaultMaxPersistentManifoldPoolSize = 256;
  info.m_defaultMaxCollisionAlgorithmPoolSize = 512;
  return info;
}

}  // namespace

void BulletBackend::Params::visit(ParamVisitor& v) {
  v.param("step_seconds", step_seconds, {"Length of one step of the timeline.", "s", 1e-4, 0.1});
  v.param("sub_steps", sub_steps, {"Solver steps in one step.", "", 1, 64});
  v.param("gravity", gravity, {"Acceleration of bodies that have gravity.", "m/s^2", -1000, 1000});
  v.param("linear_damping", linear_damping,
          {"Share of its speed that a falling body loses in a second.", "", 0, 1});
  v.param("angular_damping", angular_damping,
          {"Share of its spin that a falling body loses in a second.", "", 0, 1});
  v.param(
      "floating_damping", floating_damping,
      {"Share of speed and spin that a body without gravity loses in a second, so that a pushed "
       "one comes to a stop.",
       "", 0, 1});
  v.param("rolling_friction", rolling_friction,
          {"Rolling resistance as a share of a body's radius, so that balls stop.", "", 0, 1});
  v.param("solver_iterations", solver_iterations,
          {"Sweeps of the contact solver per solver step.", "", 1, 1000});
  v.param(
      "ccd", ccd,
      {"Continuous detection for fast and small bodies, which else tunnel through thin things."});
  v.param("margin_m", margin_m,
          {"Thickness of the skin that keeps hulls and triangle meshes apart.", "m", 0, 0.05});
  v.param("max_depenetration_speed", max_depenetration_speed,
          {"Speed at which overlapping bodies are pushed apart; they do not keep it.", "m/s", 0.01,
           100});
  v.param("sleep_speed", sleep_speed,
          {"A body slower than this for two seconds falls asleep.", "m/s", 0, 10});
  v.param("hull_vertices", hull_vertices,
          {"Corners of a convex hull at most; more are slower and follow the mesh closer.", "", 16,
           512});
  v.param("hidden_collide", hidden_collide,
          {"What assets hide collides as well: collision meshes. What a job hides never does."});
}

/// Members are destroyed last to first: the world before the bodies it points at.
struct BulletBackend::World {
  World(const Params& params, std::shared_ptr<ShapeCache> shape_cache)
      : cache(std::move(shape_cache)),
        dispatcher(&configuration),
        dynamics(&dispatcher, &broadphase, &solver, &configuration,
                 params.max_depenetration_speed) {}

  std::shared_ptr<ShapeCache> cache;
  Bodies bodies;
  MeshCollisionConfiguration configuration{small_pools()};
  btCollisionDispatcher dispatcher;
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  SoftContactWorld dynamics;
  Carrier carrier{dynamics};

  ~World() {
    for (const HeldJoint& held : bodies.joints) dynamics.removeConstraint(held.constraint.get());
    for (const MovingBody& moving : bodies.moving) dynamics.removeRigidBody(moving.body.get());
    for (const StaticObject& fixed : bodies.statics) {
      dynamics.removeCollisionObject(fixed.object.get());
    }
  }
};

BulletBackend::BulletBackend(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      world_(std::make_unique<World>(
          params_, ShapeCache::shared(std::size_t(params_.hull_vertices), params_.margin_m))) {}

BulletBackend::~BulletBackend() = default;

void BulletBackend::do_reset(const Scene& scene) {
  world_ = std::make_unique<World>(params_, std::move(world_->cache));
  World& world = *world_;
  // Bullet finds one point of two hulls per step, and so a face only in time. Where there are fewer
  // than three, it looks for more with the hulls turned a little.
  world.configuration.setConvexConvexMultipointIterations(3, 3);
  world.cache->forget_dead_meshes();
  world.bodies = build_bodies(scene, params_, *world.cache);

  world.dynamics.setGravity(
      btVector3(params_.gravity.x(), params_.gravity.y(), params_.gravity.z()));
  btContactSolverInfo& info = world.dynamics.getSolverInfo();
  info.m_numIterations = params_.solver_iterations;
  info.m_splitImpulse = true;
  // Every overlap is undone by moving, none by speed.
  info.m_splitImpulsePenetrationThreshold = 0.0;
  btDispatcherInfo& detection = world.dynamics.getDispatchInfo();
  detection.m_allowedCcdPenetration = 0.0;
  detection.m_deterministicOverlappingPairs = true;

  for (std::size_t i = 0; i < world.bodies.statics.size(); ++i) {
    btCollisionObject& object = *world.bodies.statics[i].object;
    object.setUserIndex(-1 - int(i));
    world.dynamics.addCollisionObject(&object, kStaticGroup, kStaticMask);
  }
  for (std::size_t i = 0; i < world.bodies.moving.size(); ++i) {
    world.bodies.moving[i].body->setUserIndex(int(i));
    btRigidBody* const body = world.bodies.moving[i].body.get();
    if (world.bodies.moving[i].collides) {
      world.dynamics.addRigidBody(body);
    } else {
      world.dynamics.addRigidBody(body, btBroadphaseProxy::DefaultFilter, 0);
    }
    set_velocities(scene, world.bodies.moving[i]);
  }
  // Bodies that a joint holds together do not collide with each other.
  for (const HeldJoint& held : world.bodies.joints) {
    world.dynamics.addConstraint(held.constraint.get(), true);
  }
  for (const std::string& path : world.bodies.shapeless) {
    host_.log(LogLevel::Warning, path + ": a rigid body without colliders stays where it is");
  }
  for (const std::string& path : world.bodies.unheld) {
    host_.log(LogLevel::Warning, path +
                                     ": the chain of joints that it ends is none of several axes "
                                     "at right angles in one place, and holds nothing in physics");
  }
  host_.log(LogLevel::Debug, "physics: " + std::to_string(world.bodies.statics.size()) +
                                 " static colliders, " +
                                 std::to_string(world.bodies.moving.size()) + " moving bodies, " +
                                 std::to_string(world.bodies.joints.size()) + " joints");
}

void BulletBackend::do_advance(int steps) { do_advance_by(steps, params_.step_seconds); }

bool BulletBackend::do_advance_by(int steps, double step_s) {
  const double seconds = step_s / params_.sub_steps;
  for (int i = 0; i < steps * params_.sub_steps; ++i) {
    drive_followers(world_->bodies, seconds);
    world_->carrier.begin_step(seconds);
    world_->dynamics.stepSimulation(seconds, 0);
    world_->carrier.end_step();
  }
  return true;
}

void BulletBackend::do_carry(const Scene& scene, double seconds) {
  world_->carrier.aim(scene, seconds, world_->bodies.statics);
}

void BulletBackend::do_write_poses(Scene& scene) const {
  // Parents come before their children (creation order), so a body below another one finds its
  // parent where it will stay.
  for (const MovingBody& moving : world_->bodies.moving) {
    const btTransform& now = moving.body->getWorldTransform();
    const Affine world_from_node = Affine(from_bullet(now)) * moving.body_from_node;
    if (moving.is_nested || !(now == moving.start)) {
      const Affine world_from_parent = scene.world_from_node(scene[moving.node].parent);
      scene.set_pose(moving.node, world_from_parent.inverse() * world_from_node);
    }
    const Vec3 spin = from_bullet(moving.body->getAngularVelocity());
    const Vec3 arm = world_from_node.translation() - from_bullet(now.getOrigin());
    const Vec3 velocity = from_bullet(moving.body->getLinearVelocity()) + spin.cross(arm);
    const RigidBody& known = *scene[moving.node].rigid_body;
    if (known.linear_velocity == velocity && known.angular_velocity == spin) continue;
    scene.set_velocity(moving.node, velocity, spin);
  }
  for (const HeldJoint& held : world_->bodies.joints) {
    if (held.compound) place_frames(scene, *held.compound);
  }
}

PhysicsReport BulletBackend::report() const {
  const Bodies& bodies = world_->bodies;
  PhysicsReport report;
  report.moving_bodies = int(bodies.moving.size());
  for (const MovingBody& moving : bodies.moving) {
    if (!moving.body->isActive()) ++report.sleeping_bodies;
    if (!moving.has_gravity) continue;
    report.max_speed =
        std::max(report.max_speed, double(moving.body->getLinearVelocity().length()));
  }
  const btDispatcher& dispatcher = world_->dispatcher;
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold =
        *const_cast<btDispatcher&>(dispatcher).getManifoldByIndexInternal(i);
    const btCollisionObject& a = *manifold.getBody0();
    const btCollisionObject& b = *manifold.getBody1();
    const double skin = outer_margin(a, bodies) + outer_margin(b, bodies);
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      const double depth = -distance_now(manifold, manifold.getContactPoint(k)) - skin;
      if (depth <= report.max_penetration_m) continue;
      report.max_penetration_m = depth;
      report.deepest_body =
          bodies.moving[std::size_t(std::max(a.getUserIndex(), b.getUserIndex()))].path;
    }
  }
  return report;
}

}  // namespace diorama
