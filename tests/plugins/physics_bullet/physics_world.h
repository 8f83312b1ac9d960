// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "bullet_backend.h"
#include "framework/pipeline/fake_host.h"

namespace diorama::test {

/// A scene with a backend, and one-line ways to fill it.
struct PhysicsWorld {
  explicit PhysicsWorld(BulletBackend::Params params = {}) : backend(params, host) {}

  NodeId add(const std::string& name, std::shared_ptr<const Mesh> mesh, ColliderShape shape,
             const Affine& world_from_node) {
    const NodeId node = scene.create(scene.root(), name);
    scene.edit(node).mesh = std::move(mesh);
    scene.edit(node).collider = Collider{};
    scene.edit(node).collider->shape = shape;
    scene.set_pose(node, world_from_node);
    return node;
  }
  NodeId add_primitive(const std::string& name, PrimitiveShape primitive, const Vec3& size,
                       const Affine& world_from_node) {
    const NodeId node = add(name, nullptr, ColliderShape::Primitive, world_from_node);
    scene.edit(node).collider->primitive = primitive;
    scene.edit(node).collider->primitive_size = size;
    return node;
  }
  void make_body(NodeId node, double mass_kg = 1.0, bool has_gravity = true) {
    RigidBody body;
    body.mass_kg = mass_kg;
    body.has_gravity = has_gravity;
    scene.edit(node).rigid_body = body;
  }
  /// A floor whose top is at z = 0.
  NodeId add_floor() {
    return add_primitive("floor", PrimitiveShape::Box, Vec3(40, 40, 1),
                         Affine(Eigen::Translation3d(0, 0, -0.5)));
  }
  void run(int steps) {
    backend.reset(scene);
    backend.advance(scene, steps);
  }
  Vec3 position(NodeId node) const { return scene.world_from_node(node).translation(); }

  FakeHost host;
  Scene scene;
  BulletBackend backend;
};

inline Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

inline std::shared_ptr<const Mesh> shared(Mesh mesh) {
  return std::make_shared<const Mesh>(std::move(mesh));
}

}  // namespace diorama::test
