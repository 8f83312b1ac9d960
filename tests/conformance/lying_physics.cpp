// SPDX-License-Identifier: Apache-2.0
// Physics that breaks one promise each.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <vector>

#include "diorama/physics_backend.h"
#include "diorama/plugin.h"

namespace diorama::test {

struct NoParams {
  void visit(ParamVisitor&) {}
};

/// Bodies fall without turning and stop where they meet z = 0.
struct Falls : PhysicsBackend {
  using Params = NoParams;
  Falls(Params, Host& of) : host(of) {}

  struct Body {
    NodeId node;
    Affine pose;
    double low = 0.0;
    double speed = 0.0;
    bool has_gravity = true;
  };
  Host& host;
  std::vector<Body> bodies;
  double gravity = 9.81;

  double step_seconds() const override { return 0.01; }
  PhysicsReport report() const override {
    PhysicsReport report;
    for (const Body& body : bodies) {
      ++report.moving_bodies;
      if (body.speed == 0.0) ++report.sleeping_bodies;
      report.max_speed = std::max(report.max_speed, std::abs(body.speed));
    }
    return report;
  }
  void do_reset(const Scene& scene) override {
    bodies.clear();
    for (const NodeId id : scene.subtree(scene.root())) {
      if (!scene[id].rigid_body) continue;
      const RigidBody& body = *scene[id].rigid_body;
      bodies.push_back({id, scene.world_from_node(id), scene.world_bounds(id).min.z(),
                        body.has_gravity ? body.linear_velocity.z() : 0.0, body.has_gravity});
    }
  }
  void do_advance(int steps) override {
    for (Body& body : bodies) {
      for (int i = 0; i < steps; ++i) step(body);
    }
  }
  virtual void step(Body& body) {
    if (!body.has_gravity) return;
    body.speed -= gravity * step_seconds();
    const double drop = -body.speed * step_seconds();
    const double room = std::max(0.0, body.low);
    if (drop >= room) body.speed = 0.0;
    body.low -= std::min(drop, room);
    body.pose.pretranslate(Vec3(0, 0, -std::min(drop, room)));
  }
  void do_write_poses(Scene& scene) const override {
    for (const Body& body : bodies) {
      const Affine parent = scene.world_from_node(scene[body.node].parent);
      scene.set_pose(body.node, parent.inverse() * body.pose);
      scene.edit(body.node).rigid_body->linear_velocity = Vec3(0, 0, body.speed);
    }
  }
};

struct OnTheMoon : Falls {
  OnTheMoon(Params params, Host& of) : Falls(params, of) { gravity = 1.62; }
};
/// Takes steps of another length than it says.
struct SaysOtherSteps : Falls {
  using Falls::Falls;
  double step_seconds() const override { return is_asked ? 0.02 : 0.01; }
  bool is_asked = true;
  void do_advance(int steps) override {
    is_asked = false;
    Falls::do_advance(steps);
    is_asked = true;
  }
};
struct OneStepPerCall : Falls {
  using Falls::Falls;
  void do_advance(int steps) override {
    // As far as so many steps would bring it, at the speed of now.
    for (Body& body : bodies) {
      for (int i = 0; i < steps; ++i) step(body);
      if (steps > 1) body.pose.pretranslate(Vec3(0, 0, -1e-3));
    }
  }
};
struct KeepsSpeeds : Falls {
  using Falls::Falls;
  void do_reset(const Scene& scene) override {
    std::vector<Body> before = std::move(bodies);
    Falls::do_reset(scene);
    for (std::size_t i = 0; i < std::min(before.size(), bodies.size()); ++i) {
      bodies[i].speed = before[i].speed - 0.1;
    }
  }
};
struct StartsAtRest : Falls {
  using Falls::Falls;
  void do_reset(const Scene& scene) override {
    Falls::do_reset(scene);
    for (Body& body : bodies) body.speed = 0.0;
  }
};
struct ForgetsToSayHowFast : Falls {
  using Falls::Falls;
  void do_write_poses(Scene& scene) const override {
    Falls::do_write_poses(scene);
    for (const Body& body : bodies) {
      scene.edit(body.node).rigid_body->linear_velocity = Vec3::Zero();
    }
  }
};
struct DrawsEverythingDown : Falls {
  using Falls::Falls;
  void do_reset(const Scene& scene) override {
    Falls::do_reset(scene);
    for (Body& body : bodies) body.has_gravity = true;
  }
};
struct Drifts : Falls {
  using Falls::Falls;
  void step(Body& body) override {
    Falls::step(body);
    if (body.speed != 0.0) body.pose.pretranslate(Vec3(1e-3, 0, 0));
  }
};
struct Shrinks : Falls {
  using Falls::Falls;
  void do_write_poses(Scene& scene) const override {
    Falls::do_write_poses(scene);
    for (const Body& body : bodies) {
      Affine pose = scene[body.node].parent_from_node;
      pose.scale(0.99);
      scene.set_pose(body.node, pose);
    }
  }
};
struct Relabels : Falls {
  using Falls::Falls;
  void do_write_poses(Scene& scene) const override {
    Falls::do_write_poses(scene);
    for (const Body& body : bodies) scene.edit(body.node).labels["state"] = "moved";
  }
};
struct ReportsNothing : Falls {
  using Falls::Falls;
  PhysicsReport report() const override { return {}; }
};
struct ReportsStuckThings : Falls {
  using Falls::Falls;
  PhysicsReport report() const override {
    PhysicsReport report = Falls::report();
    report.max_penetration_m = 0.02;
    report.deepest_body = "/Environment/floor";
    return report;
  }
};
struct FallsThrough : Falls {
  using Falls::Falls;
  void do_reset(const Scene& scene) override {
    Falls::do_reset(scene);
    for (Body& body : bodies) body.low += 100.0;
  }
};
struct ByThreads : Falls {
  using Falls::Falls;
  void do_advance(int steps) override {
    Falls::do_advance(steps);
    for (Body& body : bodies) body.pose.pretranslate(Vec3(0, 0, -1e-9 * host.thread_count()));
  }
};
struct ByTheClock : Falls {
  using Falls::Falls;
  void do_advance(int steps) override {
    Falls::do_advance(steps);
    const double seconds = double(std::time(nullptr) % 1000);
    for (Body& body : bodies) body.pose.pretranslate(Vec3(0, 0, -1e-9 * seconds));
  }
};
/// One world for all.
struct OneWorld : Falls {
  using Falls::Falls;
  static inline std::atomic<int> at_work{0};
  void do_advance(int steps) override {
    const int others = at_work++;
    ::usleep(20000);
    Falls::do_advance(steps);
    if (at_work > 1 || others > 0) {
      for (Body& body : bodies) body.pose.pretranslate(Vec3(0, 0, -1e-3));
    }
    ::usleep(20000);
    --at_work;
  }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_physics", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(Falls, "honest", "Lets things fall.");
  DIORAMA_ADD(OnTheMoon, "on_the_moon", "Lets things fall slowly.");
  DIORAMA_ADD(SaysOtherSteps, "says_other_steps", "Steps too short.");
  DIORAMA_ADD(OneStepPerCall, "counts_calls", "Moves things by calls.");
  DIORAMA_ADD(KeepsSpeeds, "keeps_speeds", "Remembers speeds.");
  DIORAMA_ADD(StartsAtRest, "starts_at_rest", "Forgets what was thrown.");
  DIORAMA_ADD(ForgetsToSayHowFast, "hides_speeds", "Writes no speeds.");
  DIORAMA_ADD(DrawsEverythingDown, "draws_all_down", "Knows no floating.");
  DIORAMA_ADD(Drifts, "drifts", "Pushes sideways.");
  DIORAMA_ADD(Shrinks, "shrinks", "Makes things smaller.");
  DIORAMA_ADD(Relabels, "relabels", "Names what it moved.");
  DIORAMA_ADD(ReportsNothing, "reports_nothing", "Tells nothing.");
  DIORAMA_ADD(ReportsStuckThings, "reports_the_floor", "Tells of no body.");
  DIORAMA_ADD(FallsThrough, "falls_through", "Knows no floor.");
  DIORAMA_ADD(ByThreads, "by_threads", "Looks at the machine.");
  DIORAMA_ADD(ByTheClock, "by_the_clock", "Looks at the clock.");
  DIORAMA_ADD(OneWorld, "one_world", "Shares its world.");
}
