// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "diorama/geometry.h"
#include "triangle_edges.h"

namespace diorama {

/// A mesh's triangles, stretched, with a bounding volume tree. Not movable: the parts point at each
/// other.
struct StaticMesh {
  StaticMesh(const Mesh& mesh, const Mat3& stretch, double margin_m);
  StaticMesh(const StaticMesh&) = delete;
  StaticMesh& operator=(const StaticMesh&) = delete;

  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Without degenerate ones.
  std::vector<InnerEdges> inner_edges;                  ///< Per triangle.
  std::unique_ptr<btTriangleIndexVertexArray> arrays;
  std::unique_ptr<btBvhTriangleMeshShape> shape;  ///< Null when no triangle is left.
};

/// Keeps what is dear to make of a mesh for as long as the mesh lives: the asset that returns with
/// the next visit finds its hull and its tree. What is found equals what would be made, bit by bit.
/// From any thread; two that miss the same thing at once both make it.
class ShapeCache {
 public:
  ShapeCache(std::size_t hull_points, double margin_m);
  /// That of all backends of the process with these numbers: visits that go on side by side meet in
  /// the same rooms. It lives as long as somebody holds it.
  static std::shared_ptr<ShapeCache> shared(std::size_t hull_points, double margin_m);

  /// Corners of the mesh's reduced hull, in mesh space. Empty for a mesh without extent.
  std::shared_ptr<const std::vector<Vec3>> hull_points(const std::shared_ptr<const Mesh>& mesh);
  std::shared_ptr<const StaticMesh> static_mesh(const std::shared_ptr<const Mesh>& mesh,
                                                const Mat3& stretch);
  void forget_dead_meshes();

 private:
  template <class Made>
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    std::shared_ptr<const Made> made;
  };
  using TreeKey = std::pair<const Mesh*, std::array<double, 9>>;
  /// The entry, made by make() if there is none of this mesh.
  template <class Key, class Made, class Make>
  std::shared_ptr<const Made> find(std::map<Key, Entry<Made>>& entries, const Key& key,
                                   const std::shared_ptr<const Mesh>& mesh, const Make& make);

  std::size_t max_hull_points_;
  double margin_m_;
  std::mutex mutex_;
  // Looked up only, never walked in an order that would matter: keys are addresses.
  std::map<const Mesh*, Entry<std::vector<Vec3>>> hulls_;
  std::map<TreeKey, Entry<StaticMesh>> trees_;
};

}  // namespace diorama
