// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "box_tree.h"
#include "diorama/scene.h"

namespace diorama {

/// What the ray through a pixel centre meets; world space unless said otherwise.
struct SurfacePoint {
  NodeId node;  ///< Null: nothing was hit, and the rest is meaningless.
  double distance = kInfinity;
  Vec3 position = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< Unit, interpolated, facing the ray's origin.
  Vec2f uv = Vec2f::Zero();
  Vec3f albedo = Vec3f::Zero();
};

/// The visible meshes of a scene, ready for ray queries. Trees of shared meshes are kept from one
/// take() to the next. Queries may come from many threads, take() from one.
class NullScene {
 public:
  void take(const Scene& scene);

  /// The first surface that is not cut out by its opacity. Distances are those of the segment's
  /// parameter, so give a unit direction.
  SurfacePoint first_hit(Segment segment) const;

  /// A part of the scene: only the given nodes. Nodes without a visible mesh count for nothing.
  struct Part {
    std::vector<std::uint32_t> instances;
    Aabb bounds;
  };
  Part part(std::span<const NodeId> nodes) const;
  /// To its first surface; infinity where the segment misses it.
  double distance(const Part& part, Segment segment) const;

 private:
  struct Triangles {
    std::weak_ptr<const Mesh> owner;
    BoxTree tree;
  };
  struct Instance {
    NodeId node;
    const Node* source = nullptr;
    const BoxTree* tree = nullptr;
    Affine world_from_node = Affine::Identity();
    Affine node_from_world = Affine::Identity();
    Aabb bounds;
  };
  struct Hit {
    std::uint32_t instance = 0;
    std::uint32_t triangle = 0;
    double u = 0.0;
    double v = 0.0;
  };

  void add(const Scene& scene, NodeId node, const Affine& world_from_parent);
  const BoxTree& tree_of(const std::shared_ptr<const Mesh>& mesh);
  std::optional<Hit> intersect(std::uint32_t instance, Segment& segment) const;
  SurfacePoint describe(const Hit& hit, const Segment& segment) const;

  std::map<const Mesh*, Triangles> trees_;
  std::vector<Instance> instances_;
  BoxTree top_;
};

}  // namespace diorama
