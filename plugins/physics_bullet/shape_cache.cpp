// SPDX-License-Identifier: Apache-2.0
#include "shape_cache.h"

#include <algorithm>

#include "convex_hull.h"

namespace diorama {
namespace {

bool has_area(const std::vector<Vec3f>& positions, const std::array<std::uint32_t, 3>& triangle) {
  const Vec3 a = positions[triangle[0]].cast<double>();
  const Vec3 ab = positions[triangle[1]].cast<double>() - a;
  const Vec3 ac = positions[triangle[2]].cast<double>() - a;
  const double longest = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
  return ab.cross(ac).norm() > 1e-9 * longest && longest > 1e-16;
}

/// Positions that triangles use: what cannot be seen does not collide.
std::vector<Vec3> used_positions(const Mesh& mesh) {
  std::vector<bool> is_used(mesh.positions.size(), false);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) is_used[corner] = true;
  }
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < is_used.size(); ++i) {
    if (is_used[i]) points.push_back(mesh.positions[i].cast<double>());
  }
  return points;
}

template <class Map>
void erase_dead(Map& map) {
  for (auto entry = map.begin(); entry != map.end();) {
    entry = entry->second.mesh.expired() ? map.erase(entry) : std::next(entry);
  }
}

}  // namespace

StaticMesh::StaticMesh(const Mesh& mesh, const Mat3& stretch, double margin_m) {
  positions.reserve(mesh.positions.size());
  for (const Vec3f& position : mesh.positions) {
    positions.push_back((stretch * position.cast<double>()).cast<float>());
  }
  for (const auto& triangle : mesh.triangles) {
    if (has_area(positions, triangle)) triangles.push_back(triangle);
  }
  if (triangles.empty()) return;
  inner_edges = find_inner_edges(positions, triangles);
  btIndexedMesh indexed;
  indexed.m_numTriangles = int(triangles.size());
  indexed.m_triangleIndexBase = reinterpret_cast<const unsigned char*>(triangles.data());
  indexed.m_triangleIndexStride = int(sizeof(triangles[0]));
  indexed.m_numVertices = int(positions.size());
  indexed.m_vertexBase = reinterpret_cast<const unsigned char*>(positions.data());
  indexed.m_vertexStride = int(sizeof(positions[0]));
  indexed.m_vertexType = PHY_FLOAT;
  arrays = std::make_unique<btTriangleIndexVertexArray>();
  arrays->addIndexedMesh(indexed, PHY_INTEGER);
  shape = std::make_unique<btBvhTriangleMeshShape>(arrays.get(), true);
  shape->setMargin(margin_m);
}

ShapeCache::ShapeCache(std::size_t hull_points, double margin_m)
    : max_hull_points_(hull_points), margin_m_(margin_m) {}

std::shared_ptr<ShapeCache> ShapeCache::shared(std::size_t hull_points, double margin_m) {
  static std::mutex mutex;
  static std::map<std::pair<std::size_t, double>, std::weak_ptr<ShapeCache>> caches;
  const std::lock_guard lock(mutex);
  std::weak_ptr<ShapeCache>& known = caches[{hull_points, margin_m}];
  std::shared_ptr<ShapeCache> cache = known.lock();
  if (!cache) known = cache = std::make_shared<ShapeCache>(hull_points, margin_m);
  return cache;
}

template <class Key, class Made, class Make>
std::shared_ptr<const Made> ShapeCache::find(std::map<Key, Entry<Made>>& entries, const Key& key,
                                             const std::shared_ptr<const Mesh>& mesh,
                                             const Make& make) {
  {
    const std::lock_guard lock(mutex_);
    const auto known = entries.find(key);
    if (known != entries.end() && known->second.mesh.lock() == mesh) return known->second.made;
  }
  std::shared_ptr<const Made> made = make();
  const std::lock_guard lock(mutex_);
  Entry<Made>& entry = entries[key];
  if (entry.mesh.lock() != mesh) entry = {mesh, std::move(made)};
  return entry.made;
}

std::shared_ptr<const std::vector<Vec3>> ShapeCache::hull_points(
    const std::shared_ptr<const Mesh>& mesh) {
  return find(hulls_, mesh.get(), mesh, [&] {
    const std::vector<Vec3> points = used_positions(*mesh);
    Aabb box;
    for (const Vec3& point : points) box.add(point);
    const double extent = box.is_empty() ? 0.0 : box.size().maxCoeff();
    using Hull = const std::vector<Vec3>;
    if (!(extent > 0.0)) return std::make_shared<Hull>();
    // A relative thickness makes the hull of a sheet computable whatever the mesh's unit is.
    return std::make_shared<Hull>(
        reduced_hull_points(thickened(points, 1e-4 * extent), max_hull_points_));
  });
}

std::shared_ptr<const StaticMesh> ShapeCache::static_mesh(const std::shared_ptr<const Mesh>& mesh,
                                                          const Mat3& stretch) {
  TreeKey key{mesh.get(), {}};
  std::copy(stretch.data(), stretch.data() + 9, key.second.begin());
  return find(trees_, key, mesh,
              [&] { return std::make_shared<const StaticMesh>(*mesh, stretch, margin_m_); });
}

void ShapeCache::forget_dead_meshes() {
  const std::lock_guard lock(mutex_);
  erase_dead(hulls_);
  erase_dead(trees_);
}

}  // namespace diorama
