// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "embree.h"
#include "renderer_support/batch.h"
#include "renderer_support/isa.h"
#include "renderer_support/light_table.h"
#include "renderer_support/rigid_motion.h"
#include "renderer_support/sampling.h"
#include "renderer_support/shading_material.h"
#include "renderer_support/shading_mesh.h"

namespace diorama {

/// One visible mesh node, in world space.
struct MeshInstance {
  static constexpr std::uint32_t kNoLight = 0xFFFFFFFFu;

  std::shared_ptr<const ShadingMesh> shading;
  bool is_movable = false;  ///< Follows a rigid body.
  Eigen::Matrix3f normal_from_node = Eigen::Matrix3f::Identity();
  bool is_mirrored = false;                       ///< The pose turns front sides into back sides.
  std::vector<const ShadingMaterial*> materials;  ///< Per slot.
  /// Per triangle: number of its light or kNoLight. Empty where nothing emits.
  std::vector<std::uint32_t> triangle_lights;
  NodeId node;
  std::shared_ptr<const Mesh> mesh;
  Affine world_from_node = Affine::Identity();
  std::vector<float> world_positions;  ///< x, y, z per vertex and one float of padding.
  /// The same at equal steps through the shutter's window; empty for what does not move in it.
  std::vector<std::vector<float>> blurred_positions;
  RigidMotion motion;
  double window = 0.0;  ///< Seconds.
  Aabb bounds;
  RTCGeometry geometry = nullptr;  ///< Owned by the RTCScene.

  /// A direction at the moment of the poses, as it is at another time of the shutter's window.
  Vec3f turned(const Vec3f& direction, float time) const;
  std::size_t slot(std::uint32_t triangle) const {
    return std::min(shading->slot(triangle), materials.size() - 1);
  }
  const ShadingMaterial& material(std::uint32_t triangle) const {
    return materials.size() == 1 ? *materials[0] : *materials[slot(triangle)];
  }
  Vec3f vertex(std::uint32_t index) const {
    return Eigen::Map<const Vec3f>(&world_positions[3 * std::size_t(index)]);
  }
  Vec2f uv(std::uint32_t triangle, float u, float v) const {
    if (!shading->has_uvs()) return Vec2f::Zero();
    const auto& corners = shading->uvs(triangle);
    return corners[0] * (1.0f - u - v) + corners[1] * u + corners[2] * v;
  }
};

/// The moment of the scene's poses, which lies in the middle of the shutter's window.
inline constexpr float kMoment = 0.5f;

/// Where a ray met a mesh.
struct RayHit {
  const MeshInstance* instance = nullptr;  ///< Null: nothing.
  std::uint32_t geometry = 0;
  std::uint32_t triangle = 0;  ///< Its number in the instance's ShadingMesh; u and v likewise.
  float u = 0.0f;
  float v = 0.0f;
  float distance = kInfinite;
  float time = kMoment;          ///< Share of the shutter's window.
  Vec3f normal = Vec3f::Zero();  ///< Of the triangle, as long as twice its area.
  explicit operator bool() const { return instance != nullptr; }
};

/// A hit as Embree tells it, on the triangle that it belongs to. The quad's corners a, b, c, d are
/// the triangles a, b, d and c, d, b; u leads from a to b, v from a to d.
inline ShadingMesh::Point point_on_triangle(std::uint32_t primitive, float u, float v) {
  if constexpr (!embree::kTakesQuads) return {primitive, u, v};
  const bool is_second = u + v > 1.0f;
  return {2 * primitive + std::uint32_t(is_second), is_second ? 1.0f - u : u,
          is_second ? 1.0f - v : v};
}

/// What the rays of a batch met.
struct BatchHits {
  std::array<const MeshInstance*, kBatch> instance{};  ///< Null: nothing.
  BatchInts geometry;
  BatchInts triangle;
  BatchFloats u;
  BatchFloats v;
  BatchFloats distance;
  BatchFloats time;
  BatchVectors normal;

  RayHit at(std::size_t i) const {
    return {instance[i],
            std::uint32_t(geometry[i]),
            std::uint32_t(triangle[i]),
            u[i],
            v[i],
            distance[i],
            time[i],
            normal.at(i)};
  }
  void set(std::size_t i, const RayHit& hit) {
    instance[i] = hit.instance;
    geometry[i] = std::int32_t(hit.geometry);
    triangle[i] = std::int32_t(hit.triangle);
    u[i] = hit.u;
    v[i] = hit.v;
    distance[i] = hit.distance;
    time[i] = hit.time;
    normal.set(i, hit.normal);
  }
};

/// Up to 8 or 16 rays that are traced together, which is faster where they go similar ways.
template <int kWidth>
class RayPacket {
 public:
  static constexpr int kSize = kWidth;

  void clear() { count_ = 0; }
  /// The direction is unit length.
  void add(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max, float time) {
    put(count_++, origin, direction, t_min, t_max, time);
  }
  /// Rays of a batch from `begin` on, a multiple of the size; nothing else may be in it.
  void take(const BatchRays& rays, std::size_t begin);

 private:
  friend class RenderScene;
  void put(int i, const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
           float time);
  void finish(std::uint32_t mask);
  alignas(64) std::array<int, kSize> valid_{};
  std::conditional_t<kSize == 8, RTCRayHit8, RTCRayHit16> rays_;
  int count_ = 0;
};
using RayPacket8 = RayPacket<8>;

/// The surface at a hit, without its material. World space.
struct SurfaceGeometry {
  Vec3f position;
  Vec3f flat_normal;          ///< Unit, of the triangle, on the side of the ray's origin.
  Vec3f normal;               ///< Unit, interpolated, facing the ray's origin.
  Vec2f uv = Vec2f::Zero();   ///< Filled by RenderScene::add_uv(), if the mesh has any.
  float uv_per_metre = 0.0f;  ///< Its density on the triangle; likewise.
  bool is_back = false;       ///< The ray came from behind.
};

/// A scene uploaded for ray queries. take() is called for every change and reuses what it can:
/// textures, meshes and their trees, shading tables. Queries come from any thread; take() may not
/// run beside them. What render kernels call is inline: it is compiled into each of them.
class RenderScene {
 public:
  struct Options {
    std::string isa = "sse2";     ///< Of Embree's kernels; one of kIsaNames.
    bool has_disk_lamps = false;  ///< See LightTable.
    bool stacks_lobes = false;    ///< See SurfaceBsdf.
  };
  RenderScene(Host& host, const Options& options);
  ~RenderScene();
  RenderScene(const RenderScene&) = delete;
  RenderScene& operator=(const RenderScene&) = delete;

  void take(const Scene& scene);

  /// Wall time of the last take().
  struct Times {
    double shading_s = 0.0;  ///< Meshes, materials, textures.
    double tree_s = 0.0;
    double lights_s = 0.0;
  };
  const Times& times() const { return times_; }

  /// What is kept for scenes to come.
  struct Kept {
    std::size_t meshes = 0;
    std::size_t materials = 0;
    std::size_t textures = 0;
    std::size_t skies = 0;
    std::size_t albedo_rows = 0;
  };
  Kept kept() const;

  const std::vector<std::unique_ptr<MeshInstance>>& instances() const { return instances_; }
  const LightTable& lights() const { return lights_; }
  bool stacks_lobes() const { return options_.stacks_lobes; }

  /// The first surface not cut out. The direction is unit length.
  RayHit intersect(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const {
    return intersect(scene_, origin, direction, t_min, t_max, kMoment);
  }
  /// The same at a time within the shutter's window, in [0, 1].
  RayHit intersect(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
                   float time) const {
    return intersect(scene_over_time(), origin, direction, t_min, t_max, time);
  }
  /// The light left between two points: 0 behind anything opaque, tinted behind glass and what is
  /// partly transparent. Solid glass counts as opaque unless `passes_glass`.
  Vec3f transmittance(const Vec3f& origin, const Vec3f& direction, float t_max, bool passes_glass,
                      float time) const;
  /// The hits of a batch's rays.
  void intersect(const BatchRays& rays, BatchHits& hits) const {
    intersect(scene_over_time(), rays, hits);
  }
  /// At the moment of the poses.
  void intersect_now(const BatchRays& rays, BatchHits& hits) const {
    intersect(scene_, rays, hits);
  }
  /// Calls lit(i, share) for every ray of which light is left; spends the packet.
  template <int kWidth, class Lit>
  void transmittance(RayPacket<kWidth>& rays, bool passes_glass, Lit&& lit) const {
    transmittance(scene_over_time(), rays, passes_glass, ~0u, lit);
  }
  /// Seconds around the moment of the poses that `time` runs through; see shutter_window().
  double window() const { return window_; }
  /// Some instances of the scene with nothing else; valid until the next take().
  class SubScene {
   public:
    SubScene(const RenderScene& scene, const std::vector<std::uint32_t>& instances);
    ~SubScene();
    SubScene(const SubScene&) = delete;
    SubScene& operator=(const SubScene&) = delete;
    /// To its first surface; infinity where the ray misses it.
    float distance(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const;

   private:
    RTCScene scene_ = nullptr;
  };

  /// Of a hit of the ray from `origin`; without uv, which few surfaces need.
  static SurfaceGeometry surface_at(const RayHit& hit, const Vec3f& origin, const Vec3f& direction);
  /// The same from its parts, without a branch.
  static SurfaceGeometry surface_of(const Vec3f& position, const Vec3f& direction,
                                    const Vec3f& triangle_normal, const Vec3f& interpolated,
                                    bool is_mirrored);
  /// World space, not unit length; zero for meshes without normals.
  static Vec3f interpolated_normal(const RayHit& hit);
  static void add_uv(SurfaceGeometry& surface, const RayHit& hit);

 private:
  /// Kept while anybody else, a scene or a cache of assets, keeps the image.
  struct CachedDome {
    std::weak_ptr<const Texture> owner;
    std::shared_ptr<const DomeTexture> dome;
  };
  using Instances = std::vector<std::unique_ptr<MeshInstance>>;
  /// What decides which parts of the sky can be seen: all that does not follow a rigid body.
  struct Surroundings {
    std::vector<std::shared_ptr<const Mesh>> meshes;
    std::vector<Eigen::Matrix4d> poses;
    std::vector<std::shared_ptr<const Material>> clear_materials;  ///< That let light pass.
    Aabb bounds;
    bool operator==(const Surroundings& other) const {
      return meshes == other.meshes && poses == other.poses &&
             clear_materials == other.clear_materials;
    }
  };
  struct CachedGrid {
    std::shared_ptr<const DomeTexture> dome;
    Eigen::Matrix3f world_from_dome;
    std::shared_ptr<const SkyGrid> grid;
  };
  /// Ray masks of meshes; light sees all of them.
  static constexpr std::uint32_t kStaticMask = 1;
  static constexpr std::uint32_t kMovableMask = 2;

  /// Carried by shadow rays; the filter of the surfaces on their way attenuates what they carry.
  struct ShadowContext {
    embree::Context context;
    std::array<Vec3f, 16> transmittance;  ///< By the rays' ids; set when is_attenuated.
    bool is_attenuated = false;
    bool passes_glass = true;
    void attenuate(unsigned ray, const Vec3f& share) {
      if (!is_attenuated) transmittance.fill(Vec3f::Ones());
      is_attenuated = true;
      transmittance[ray] = transmittance[ray].cwiseProduct(share);
    }
  };

  static RTCRayHit make_ray(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
                            float time);
  void intersect(RTCScene scene, const BatchRays& rays, BatchHits& hits) const;
  void intersect(RTCScene scene, RayPacket8& rays, bool is_coherent, std::size_t begin,
                 BatchHits& hits) const;
  RayHit intersect(RTCScene scene, const Vec3f& origin, const Vec3f& direction, float t_min,
                   float t_max, float time) const;
  template <int kWidth, class Lit>
  static void transmittance(RTCScene scene, RayPacket<kWidth>& rays, bool passes_glass,
                            std::uint32_t mask, Lit&& lit);
  RTCScene scene_over_time() const { return moving_scene_ ? moving_scene_ : scene_; }
  static void attenuate_shadow_ray(const RTCFilterFunctionNArguments* args);
  void collect(const Scene& scene, NodeId node, const Affine& world_from_parent, bool is_movable);
  void assign_materials(const Scene& scene);
  void assign_shading_meshes();
  void pack_uvs();
  void upload(const Instances& previous);
  bool can_keep(const Instances& previous) const;
  void build_all();
  static void set_filters(const MeshInstance& instance, RTCGeometry geometry);
  RTCGeometry make_geometry(MeshInstance& instance) const;
  static Aabb place(const Mesh& mesh, const Affine& pose, std::vector<float>& positions);
  RTCGeometry new_geometry(const ShadingMesh& mesh) const;
  void blur(const Scene& scene);
  void release_moving_scene();
  void add_moving_geometry(std::uint32_t index);
  Surroundings surroundings() const;
  void learn_sky();
  void add_lights(const Scene& scene);
  void add_emitters();
  void check_device(const char* action) const;

  Host& host_;
  Options options_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  RTCScene moving_scene_ = nullptr;  ///< scene_ with its motion; null when nothing moves.
  double window_ = 0.0;
  Times times_;
  MaterialLibrary materials_;
  std::map<const Mesh*, std::shared_ptr<ShadingMesh>> shading_meshes_;
  std::map<const Texture*, CachedDome> domes_;
  std::shared_ptr<const Material> default_material_;
  std::shared_ptr<const Texture> white_sky_;  ///< Of domes without an image.
  Instances instances_;
  std::vector<NodeId> light_nodes_;
  LightTable lights_;
  Surroundings surroundings_;
  std::vector<CachedGrid> sky_grids_;  ///< Valid for surroundings_.
};

inline RTCRayHit RenderScene::make_ray(const Vec3f& origin, const Vec3f& direction, float t_min,
                                       float t_max, float time) {
  RTCRayHit ray;
  ray.ray.org_x = origin.x();
  ray.ray.org_y = origin.y();
  ray.ray.org_z = origin.z();
  ray.ray.dir_x = direction.x();
  ray.ray.dir_y = direction.y();
  ray.ray.dir_z = direction.z();
  ray.ray.tnear = t_min;
  ray.ray.tfar = t_max;
  ray.ray.time = time;
  ray.ray.mask = ~0u;
  ray.ray.id = 0;
  ray.ray.flags = 0;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

inline RayHit RenderScene::intersect(RTCScene scene, const Vec3f& origin, const Vec3f& direction,
                                     float t_min, float t_max, float time) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max, time);
  embree::Context context;
  embree::init(context);
  embree::intersect(scene, context, ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const auto point = point_on_triangle(ray.hit.primID, ray.hit.u, ray.hit.v);
  instances_[ray.hit.geomID]->shading->prefetch(point.triangle);
  return {instances_[ray.hit.geomID].get(),
          ray.hit.geomID,
          point.triangle,
          point.u,
          point.v,
          ray.ray.tfar,
          time,
          {ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z}};
}

inline Vec3f RenderScene::transmittance(const Vec3f& origin, const Vec3f& direction, float t_max,
                                        bool passes_glass, float time) const {
  RTCRayHit ray = make_ray(origin, direction, 0.0f, t_max, time);
  ShadowContext shadow;
  shadow.passes_glass = passes_glass;
  embree::init(shadow.context);
  embree::occluded(scene_over_time(), shadow.context, ray.ray);
  if (ray.ray.tfar == -kInfinite) return Vec3f::Zero();
  return shadow.is_attenuated ? shadow.transmittance[0] : Vec3f(Vec3f::Ones());
}

template <int kWidth>
inline void RayPacket<kWidth>::put(int i, const Vec3f& origin, const Vec3f& direction, float t_min,
                                   float t_max, float time) {
  auto& r = rays_.ray;
  r.org_x[i] = origin.x();
  r.org_y[i] = origin.y();
  r.org_z[i] = origin.z();
  r.dir_x[i] = direction.x();
  r.dir_y[i] = direction.y();
  r.dir_z[i] = direction.z();
  r.tnear[i] = t_min;
  r.tfar[i] = t_max;
  r.time[i] = time;
}

template <int kWidth>
inline void RayPacket<kWidth>::take(const BatchRays& from, std::size_t begin) {
  auto& r = rays_.ray;
  std::copy_n(&from.origin.x[begin], kSize, r.org_x);
  std::copy_n(&from.origin.y[begin], kSize, r.org_y);
  std::copy_n(&from.origin.z[begin], kSize, r.org_z);
  std::copy_n(&from.direction.x[begin], kSize, r.dir_x);
  std::copy_n(&from.direction.y[begin], kSize, r.dir_y);
  std::copy_n(&from.direction.z[begin], kSize, r.dir_z);
  std::copy_n(&from.t_min[begin], kSize, r.tnear);
  std::copy_n(&from.t_max[begin], kSize, r.tfar);
  std::copy_n(&from.time[begin], kSize, r.time);
  count_ = int(std::min(from.count - begin, std::size_t(kSize)));
}

/// Fills the rest with rays that go nowhere: not all of Embree's kernels heed which are valid.
template <int kWidth>
inline void RayPacket<kWidth>::finish(std::uint32_t mask) {
  for (int i = count_; i < kSize; ++i) {
    put(i, Vec3f::Zero(), Vec3f::UnitZ(), 0.0f, -1.0f, kMoment);
  }
  for (int i = 0; i < kSize; ++i) {
    valid_[std::size_t(i)] = i < count_ ? -1 : 0;
    rays_.ray.mask[i] = mask;
    rays_.ray.id[i] = unsigned(i);
    rays_.ray.flags[i] = 0;
    rays_.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    rays_.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

inline void RenderScene::intersect(RTCScene scene, RayPacket8& packet, bool is_coherent,
                                   std::size_t begin, BatchHits& hits) const {
  packet.finish(~0u);
  RTCRayHit8& rays = packet.rays_;
  embree::Context context;
  embree::init(context);
  embree::intersect(packet.valid_.data(), scene, context, rays, is_coherent);
  for (std::size_t i = 0; i < RayPacket8::kSize; ++i) {
    const std::size_t to = begin + i;
    const bool is_met = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hits.geometry[to] = std::int32_t(rays.hit.geomID[i]);
    const auto point = point_on_triangle(rays.hit.primID[i], rays.hit.u[i], rays.hit.v[i]);
    hits.triangle[to] = std::int32_t(point.triangle);
    hits.u[to] = point.u;
    hits.v[to] = point.v;
    hits.distance[to] = is_met ? rays.ray.tfar[i] : kInfinite;
    hits.time[to] = rays.ray.time[i];
    hits.normal.x[to] = rays.hit.Ng_x[i];
    hits.normal.y[to] = rays.hit.Ng_y[i];
    hits.normal.z[to] = rays.hit.Ng_z[i];
  }
  for (int i = 0; i < packet.count_; ++i) {
    const std::size_t to = begin + std::size_t(i);
    hits.instance[to] = nullptr;
    if (rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    hits.instance[to] = instances_[rays.hit.geomID[i]].get();
    hits.instance[to]->shading->prefetch(std::uint32_t(hits.triangle[to]));
  }
}

inline void RenderScene::intersect(RTCScene scene, const BatchRays& rays, BatchHits& hits) const {
  RayPacket8 packet;
  for (std::size_t begin = 0; begin < rays.count; begin += RayPacket8::kSize) {
    packet.take(rays, begin);
    intersect(scene, packet, rays.is_coherent, begin, hits);
  }
}

template <int kWidth, class Lit>
inline void RenderScene::transmittance(RTCScene scene, RayPacket<kWidth>& packet, bool passes_glass,
                                       std::uint32_t mask, Lit&& lit) {
  packet.finish(mask);
  ShadowContext shadow;
  shadow.passes_glass = passes_glass;
  embree::init(shadow.context);
  embree::occluded(packet.valid_.data(), scene, shadow.context, packet.rays_.ray);
  for (int i = 0; i < packet.count_; ++i) {
    if (packet.rays_.ray.tfar[i] == -kInfinite) continue;
    lit(i, shadow.is_attenuated ? shadow.transmittance[std::size_t(i)] : Vec3f(Vec3f::Ones()));
  }
}

inline Vec3f RenderScene::interpolated_normal(const RayHit& hit) {
  const MeshInstance& instance = *hit.instance;
  if (!instance.shading->has_normals()) return Vec3f::Zero();
  Vec3f n = instance.normal_from_node * instance.shading->normal(hit.triangle, hit.u, hit.v);
  if (!instance.blurred_positions.empty()) [[unlikely]]
    n = instance.turned(n, hit.time);
  return n;
}

inline SurfaceGeometry RenderScene::surface_of(const Vec3f& position, const Vec3f& direction,
                                               const Vec3f& triangle_normal,
                                               const Vec3f& interpolated, bool is_mirrored) {
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

inline SurfaceGeometry RenderScene::surface_at(const RayHit& hit, const Vec3f& origin,
                                               const Vec3f& direction) {
  return surface_of(origin + hit.distance * direction, direction, hit.normal,
                    interpolated_normal(hit), hit.instance->is_mirrored);
}

inline void RenderScene::add_uv(SurfaceGeometry& s, const RayHit& hit) {
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

}  // namespace diorama
