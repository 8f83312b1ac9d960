// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "diorama/math.h"
#include "diorama/scene.h"
#include "rigid_motion.h"
#include "sampling.h"
#include "shading_material.h"
#include "shading_mesh.h"

namespace diorama {

/// The moment of the scene's poses, which lies in the middle of the shutter's window.
inline constexpr float kMoment = 0.5f;

/// How something moves while the shutter is open.
struct ShutterMotion {
  RigidMotion motion;
  double window = 0.0;  ///< Seconds.
  Affine world_from_node;

  /// A direction at the moment of the poses, as it is at another share of the window.
  Vec3f turned(const Vec3f& direction, float time) const {
    const double seconds = double(time - kMoment) * window;
    return (motion.then_from_now(seconds).linear() * direction.cast<double>()).cast<float>();
  }
  /// The way back. The motion is steady: it was the same before the moment as after it.
  Vec3f turned_back(const Vec3f& direction, float time) const {
    return turned(direction, 2.0f * kMoment - time);
  }
};

/// One visible mesh node. Points into the tables of its RenderScene.
struct MeshInstance {
  static constexpr std::uint32_t kNoLight = 0xFFFFFFFFu;

  const ShadingMesh* shading = nullptr;
  std::span<const ShadingMaterial* const> materials;  ///< Per slot.
  /// Per triangle: number of its light or kNoLight. Empty where nothing emits.
  std::span<const std::uint32_t> triangle_lights;
  const ShutterMotion* motion = nullptr;  ///< Null: it does not move while the shutter is open.
  std::uint32_t mesh = 0;                 ///< Its number in RenderScene::meshes().
  NodeId node;
  bool is_movable = false;   ///< Follows a rigid body, or an animation.
  bool is_mirrored = false;  ///< The pose turns front sides into back sides.
  Eigen::Matrix3f linear = Eigen::Matrix3f::Identity();  ///< Of world_from_node.
  Vec3f translation = Vec3f::Zero();
  Eigen::Matrix3f normal_from_node = Eigen::Matrix3f::Identity();
  Aabb bounds;  ///< In the world.

  Vec3f to_world(const Vec3f& p) const { return linear * p + translation; }
  const Mesh& source() const { return shading->source(); }
  std::size_t slot(std::uint32_t triangle) const {
    return std::min(shading->slot(triangle), materials.size() - 1);
  }
  const ShadingMaterial& material(std::uint32_t triangle) const {
    return materials.size() == 1 ? *materials[0] : *materials[slot(triangle)];
  }
  /// In the world.
  Vec3f vertex(std::uint32_t index) const { return to_world(source().positions[index]); }
  Vec2f uv(std::uint32_t triangle, float u, float v) const {
    if (!shading->has_uvs()) return Vec2f::Zero();
    const auto& corners = shading->uvs(triangle);
    return corners[0] * (1.0f - u - v) + corners[1] * u + corners[2] * v;
  }
};

/// Where a ray met a mesh.
struct RayHit {
  const MeshInstance* instance = nullptr;  ///< Null: nothing.
  std::uint32_t number = 0;                ///< Of the instance.
  std::uint32_t triangle = 0;  ///< Its number in the instance's ShadingMesh; u and v likewise.
  float u = 0.0f;
  float v = 0.0f;
  float distance = kInfinite;
  float time = kMoment;          ///< Share of the shutter's window.
  Vec3f normal = Vec3f::Zero();  ///< Of the triangle, as long as twice its area.
  explicit operator bool() const { return instance != nullptr; }
};

/// The surface at a hit, without its material. World space.
struct SurfaceGeometry {
  Vec3f position;
  Vec3f flat_normal;          ///< Unit, of the triangle, on the side of the ray's origin.
  Vec3f normal;               ///< Unit, interpolated, facing the ray's origin.
  Vec2f uv = Vec2f::Zero();   ///< Filled by add_uv(), if the mesh has any.
  float uv_per_metre = 0.0f;  ///< Its density on the triangle; likewise.
  bool is_back = false;       ///< The ray came from behind.
};

/// World space, not unit length; zero for meshes without normals.
inline Vec3f interpolated_normal(const RayHit& hit) {
  const MeshInstance& instance = *hit.instance;
  if (!instance.shading->has_normals()) return Vec3f::Zero();
  Vec3f n = instance.normal_from_node * instance.shading->normal(hit.triangle, hit.u, hit.v);
  if (instance.motion) [[unlikely]]
    n = instance.motion->turned(n, hit.time);
  return n;
}

/// From its parts, without a branch.
inline SurfaceGeometry surface_of(const Vec3f& position, const Vec3f& direction,
                                  const Vec3f& triangle_normal, const Vec3f& interpolated,
                                  bool is_mirrored) {
  SurfaceGeometry s;
  s.position = position;
  const float area2 = triangle_normal.squaredNorm();
  const Vec3f flat = select(area2 > 0.0f, triangle_normal * (1.0f / std::sqrt(area2)), -direction);
  const float facing = flat.dot(direction);
  s.is_back = (facing > 0.0f) != is_mirrored;
  s.flat_normal = flat * (facing > 0.0f ? -1.0f : 1.0f);
  const float length2 = interpolated.squaredNorm();
  const Vec3f turned = interpolated * ((s.is_back ? -1.0f : 1.0f) / std::sqrt(length2));
  const Vec3f normal = select(length2 > 0.0f, turned, s.flat_normal);
  // Seen from the visible side, a normal that points away is bent back to the horizon.
  const float away = std::max(0.0f, normal.dot(direction) + 1e-4f);
  s.normal = unit(normal - away * direction);
  return s;
}

/// Of a hit of the ray from `origin`; without uv, which few surfaces need.
inline SurfaceGeometry surface_at(const RayHit& hit, const Vec3f& origin, const Vec3f& direction) {
  return surface_of(origin + hit.distance * direction, direction, hit.normal,
                    interpolated_normal(hit), hit.instance->is_mirrored);
}

inline void add_uv(SurfaceGeometry& s, const RayHit& hit) {
  const ShadingMesh& mesh = *hit.instance->shading;
  if (!mesh.has_uvs()) return;
  const auto& uvs = mesh.uvs(hit.triangle);
  const Vec2f e = uvs[1] - uvs[0];
  const Vec2f f = uvs[2] - uvs[0];
  s.uv = uvs[0] + hit.u * e + hit.v * f;
  const float uv_area = std::abs(e.x() * f.y() - e.y() * f.x());
  const float twice_area = hit.normal.norm();
  s.uv_per_metre = twice_area > 0.0f ? std::sqrt(uv_area / twice_area) : 0.0f;
}

/// Base colour of a surface point with textures and vertex colours, linear.
Vec3f base_color_at(const RayHit& hit, const SurfaceGeometry& surface, float uv_footprint);

}  // namespace diorama
