// SPDX-License-Identifier: @LICENCE@
// The simplest physics that is of use: bodies fall without turning and stop at a level ground.
#include <diorama/physics_backend.h>
#include <diorama/plugin.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

class @CLASS@ final : public diorama::PhysicsBackend {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    double step_s = 1.0 / 60.0;
    double gravity = 9.81;
    double ground_z_m = 0.0;
    void visit(diorama::ParamVisitor& v) {
      v.param("step_s", step_s, {"Length of a step.", "s", 1e-5, 1.0});
      v.param("gravity", gravity, {"Acceleration downwards.", "m/s^2", 0.0, 1000.0});
      v.param("ground_z_m", ground_z_m, {"Height of the ground.", "m", -1e6, 1e6});
    }
  };
  @CLASS@(Params params, diorama::Host&) : params_(params) {}

  double step_seconds() const override { return params_.step_s; }

  diorama::PhysicsReport report() const override {
    diorama::PhysicsReport report;
    report.moving_bodies = int(bodies_.size());
    for (const Body& body : bodies_) {
      report.sleeping_bodies += body.is_at_rest ? 1 : 0;
      report.max_speed = std::max(report.max_speed, std::abs(body.speed));
    }
    return report;
  }

 private:
  struct Body {
    diorama::NodeId node;
    diorama::Affine world_from_node;
    double lowest_z = 0.0;  // of its meshes, world
    double speed = 0.0;     // m/s, upwards
    bool is_at_rest = false;
  };

  // World box of a body's meshes; hidden ones fall as well.
  static diorama::Aabb bounds_of(const diorama::Scene& scene, diorama::NodeId body) {
    diorama::Aabb bounds;
    for (const diorama::NodeId id : scene.subtree(body)) {
      if (!scene[id].mesh) continue;
      const diorama::Affine world_from_mesh = scene.world_from_node(id);
      for (const diorama::Vec3f& position : scene[id].mesh->positions) {
        bounds.add(world_from_mesh * position.cast<double>());
      }
    }
    return bounds;
  }

  // The world is built anew from the scene, with the velocities that it says.
  void do_reset(const diorama::Scene& scene) override {
    bodies_.clear();
    for (const diorama::NodeId id : scene.subtree(scene.root())) {
      if (!scene[id].rigid_body || !scene[id].rigid_body->has_gravity) continue;
      const diorama::Aabb bounds = bounds_of(scene, id);
      if (bounds.is_empty()) continue;
      bodies_.push_back({id, scene.world_from_node(id), bounds.min.z(),
                         scene[id].rigid_body->linear_velocity.z()});
    }
  }

  void do_advance(int steps) override {
    for (Body& body : bodies_) {
      for (int i = 0; i < steps && !body.is_at_rest; ++i) step(body);
    }
  }

  void step(Body& body) const {
    body.speed -= params_.gravity * params_.step_s;
    // What stands below the ground already is left where it is.
    const double room = std::max(0.0, body.lowest_z - params_.ground_z_m);
    double drop = -body.speed * params_.step_s;
    if (drop >= room) {
      drop = room;
      body.speed = 0.0;
      body.is_at_rest = true;
    }
    body.lowest_z -= drop;
    body.world_from_node.pretranslate(diorama::Vec3(0, 0, -drop));
  }

  // The scene is the truth between calls, so poses and velocities go back into it.
  void do_write_poses(diorama::Scene& scene) const override {
    for (const Body& body : bodies_) {
      const diorama::Affine world_from_parent = scene.world_from_node(scene[body.node].parent);
      scene.set_pose(body.node, world_from_parent.inverse() * body.world_from_node);
      scene.edit(body.node).rigid_body->linear_velocity = diorama::Vec3(0, 0, body.speed);
    }
  }

  Params params_;
  std::vector<Body> bodies_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD(@CLASS@, "@NAME@", "Lets bodies fall straight onto a level ground.");
}
