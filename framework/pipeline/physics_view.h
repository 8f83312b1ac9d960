// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
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

/// Tells what an asset hides, as it stands in for something that is seen, from what a job hides.
/// The first collides: collision meshes, walls round a working area. The second does not: nothing
/// may lie on what no picture shows.
class HiddenNodes {
 public:
  /// What has come since the last call, and is hidden, came so.
  void note_new(const Scene& scene);
  /// Of nodes that came hidden: the job hid them.
  void hidden_by_job(const std::vector<NodeId>& nodes);

  /// Takes colliders and bodies of what the job has hidden out of a scene, for as long as it lives.
  /// Hidden bodies come back at rest.
  class Aside {
   public:
    Aside(Scene& scene, const HiddenNodes& hidden);
    ~Aside();
    Aside(const Aside&) = delete;
    Aside& operator=(const Aside&) = delete;

   private:
    struct Part {
      NodeId node;
      std::optional<Collider> collider;
      std::optional<RigidBody> body;
    };
    void take(NodeId node, bool is_hidden, const HiddenNodes& hidden);

    Scene& scene_;
    std::vector<Part> parts_;
  };

 private:
  std::uint32_t first_unknown_ = 0;
  std::set<NodeId> came_hidden_;
};

}  // namespace diorama
