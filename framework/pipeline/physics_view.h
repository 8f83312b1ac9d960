// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// What a physics engine holds of a scene: everything that collides or moves, where it is and how
/// fast. Two that differ mean that the engine must look at the scene anew, or things rest on what
/// has gone.
class PhysicsView {
 public:
  explicit PhysicsView(const Scene& scene);

  /// Whether the scene still looks like this to an engine. Poses and shapes that no call changed
  /// are not compared one by one.
  bool is_of(const Scene& scene) const;

 private:
  struct Part {
    NodeId node;
    Mat4 world_from_node;
    std::shared_ptr<const Mesh> mesh;
    std::optional<Collider> collider;
    std::optional<RigidBody> body;
    std::optional<Joint> joint;
    bool is_visible = true;
  };
  static std::vector<Part> parts_of(const Scene& scene);
  static bool are_equal(const Part& a, const Part& b);

  std::uint64_t pose_revision_ = 0;
  std::uint64_t shape_revision_ = 0;
  std::vector<Part> parts_;
};

}  // namespace diorama
