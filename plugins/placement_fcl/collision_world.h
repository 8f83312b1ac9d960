// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "diorama/scene.h"

namespace diorama {

/// The meshes of one node and all below it, ready to be tried at many places. The shape is that of
/// the node's present rotation and scale.
class CollisionBody {
 public:
  CollisionBody(const Scene& scene, NodeId node);
  ~CollisionBody();
  CollisionBody(CollisionBody&&) noexcept;
  CollisionBody& operator=(CollisionBody&&) noexcept;

  bool has_shape() const;
  /// Present box in the world; empty without meshes.
  const Aabb& bounds_world() const;

 private:
  friend class CollisionWorld;
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// What stands where, for the question whether a place is free. Meshes are met at their surfaces;
/// closed ones also inside.
class CollisionWorld {
 public:
  CollisionWorld();
  ~CollisionWorld();
  CollisionWorld(const CollisionWorld&) = delete;
  CollisionWorld& operator=(const CollisionWorld&) = delete;

  /// Adds the body, moved by `shift` from where it was when it was made.
  void add(CollisionBody body, const Vec3& shift);
  /// Whether the body, moved by `shift`, would meet nothing that was added.
  bool is_free(const CollisionBody& body, const Vec3& shift) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
