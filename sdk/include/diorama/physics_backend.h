// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/component.h"
#include "diorama/scene.h"

namespace diorama {

/// State of the moving bodies, for the job's summary and for tests.
struct PhysicsReport {
  int moving_bodies = 0;
  int sleeping_bodies = 0;
  double max_speed = 0.0;          ///< m/s, over bodies with gravity.
  double max_penetration_m = 0.0;  ///< Deepest contact between a moving body and anything.
  std::string deepest_body;        ///< Path of the node in that contact.
};

/// Rigid bodies. The scene is the truth between calls; the engine holds velocities and contacts.
/// Called by one thread at a time. Same scene, same calls: same bits.
class DIORAMA_SDK_API PhysicsBackend : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Physics;

  ~PhysicsBackend() override;

  /// Builds the engine's world anew from every node with a collider, hidden ones too. Bodies go on
  /// with the velocities that the scene says.
  void reset(const Scene& scene);
  /// Takes `steps` fixed steps (0 or more), then writes poses and velocities of moving bodies.
  /// Throws Error naming the node when a pose is not finite.
  void advance(Scene& scene, int steps);
  /// The same in steps of another length, in seconds above 0. Throws Error(Config) when the backend
  /// knows no length but its own.
  void advance(Scene& scene, int steps, double step_s);
  /// Colliders that no rigid body holds go evenly, in the next `seconds` (above 0) of simulation,
  /// to where the scene has them now, and push what is in their way; then they stand still. Shapes
  /// stay those of the reset. Backends that cannot leave everything where the reset found it.
  void carry(const Scene& scene, double seconds);
  virtual double step_seconds() const = 0;
  virtual PhysicsReport report() const = 0;

 private:
  virtual void do_reset(const Scene& scene) = 0;
  virtual void do_advance(int steps) = 0;                // steps > 0
  virtual bool do_advance_by(int steps, double step_s);  // false: takes none
  virtual void do_write_poses(Scene& scene) const = 0;
  virtual void do_carry(const Scene& scene, double seconds);
};

}  // namespace diorama
