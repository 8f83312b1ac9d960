// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "embree.h"
#include "renderer_support/batch.h"
#include "renderer_support/mesh_instance.h"
#include "renderer_support/render_scene.h"
#include "renderer_support/sampling.h"

namespace diorama {

/// A hit as Embree tells it, on the triangle that it belongs to. The quad's corners a, b, c, d are
/// the triangles a, b, d and c, d, b; u leads from a to b, v from a to d.
inline ShadingMesh::Point point_on_triangle(std::uint32_t primitive, float u, float v) {
  if constexpr (!embree::kTakesQuads) return {primitive, u, v};
  const bool is_second = u + v > 1.0f;
  return {2 * primitive + std::uint32_t(is_second), is_second ? 1.0f - u : u,
          is_second ? 1.0f - v : v};
}

/// What lets rays through that ask what is in the way. Cut-outs do where their opacity is below
/// their threshold; all else in part, by what it absorbs and mirrors.
enum class Passage : std::uint8_t {
  CutOuts,
  Panes,  ///< Also what is partly transparent, and thin glass ...
  Glass,  ///< ... and solid one, straight.
};

/// What the rays of a batch met.
struct BatchHits {
  std::array<const MeshInstance*, kBatch> instance{};  ///< Null: nothing.
  BatchInts number;                                    ///< Of the instances.
  BatchInts triangle;
  BatchFloats u;
  BatchFloats v;
  BatchFloats distance;
  BatchFloats time;
  BatchVectors normal;

  RayHit at(std::size_t i) const {
    return {instance[i],
            std::uint32_t(number[i]),
            std::uint32_t(triangle[i]),
            u[i],
            v[i],
            distance[i],
            time[i],
            normal.at(i)};
  }
  void set(std::size_t i, const RayHit& hit) {
    instance[i] = hit.instance;
    number[i] = std::int32_t(hit.number);
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
  void load(const BatchRays& rays, std::size_t begin);

 private:
  friend class EmbreeScene;
  void put(int i, const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
           float time);
  void pad(std::uint32_t mask);
  alignas(64) std::array<int, kSize> valid_{};
  std::conditional_t<kSize == 8, RTCRayHit8, RTCRayHit16> rays_;
  int count_ = 0;
};
using RayPacket8 = RayPacket<8>;

/// A scene and Embree's trees over it. take() is called for every change and reuses what it can.
/// Queries come from any thread; take() may not run beside them. What render kernels call is
/// inline: it is compiled into each of them.
///
/// A mesh that is used once has a tree in world space, the fastest for rays. A mesh that is used
/// several times has one tree in its own space, which its instances share: they cost a pose each.
class EmbreeScene {
 public:
  struct Options {
    std::string isa = "sse2";  ///< Of Embree's kernels; one of kIsaNames.
    RenderScene::Options scene;
  };
  EmbreeScene(Host& host, const Options& options);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  /// `beside` is called once render_scene() is as the scene is, on another thread while the trees
  /// are made, if the lights can do without these.
  void take(
      const Scene& scene, const std::function<void()>& beside = [] {});

  /// Wall time of the last take().
  struct Times {
    double shading_s = 0.0;  ///< Meshes, materials, textures.
    double tree_s = 0.0;
    double lights_s = 0.0;
  };
  const Times& times() const { return times_; }

  /// What the trees over triangles are made of.
  struct Trees {
    std::size_t in_world = 0;  ///< Of meshes that are used once.
    std::size_t shared = 0;    ///< Of meshes that are used several times.
    std::size_t vertices = 0;  ///< Of all of them.
  };
  Trees trees() const;
  RenderScene::Kept kept() const { return scene_.kept(); }

  const RenderScene& render_scene() const { return scene_; }
  const std::vector<MeshInstance>& instances() const { return scene_.instances(); }
  const LightTable& lights() const { return scene_.lights(); }
  bool stacks_lobes() const { return scene_.stacks_lobes(); }
  double window() const { return scene_.window(); }

  /// The first surface not cut out. The direction is unit length.
  RayHit intersect(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const {
    return intersect(tree_.get(), origin, direction, t_min, t_max, kMoment);
  }
  /// The same at a time within the shutter's window, in [0, 1].
  RayHit intersect(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
                   float time) const {
    return intersect(tree_over_time(), origin, direction, t_min, t_max, time);
  }
  /// The light left between two points: 0 behind anything opaque, tinted behind glass and what is
  /// partly transparent.
  Vec3f transmittance(const Vec3f& origin, const Vec3f& direction, float t_max, Passage passage,
                      float time) const;
  /// The hits of a batch's rays.
  void intersect(const BatchRays& rays, BatchHits& hits) const {
    intersect(tree_over_time(), rays, hits);
  }
  /// At the moment of the poses.
  void intersect_now(const BatchRays& rays, BatchHits& hits) const {
    intersect(tree_.get(), rays, hits);
  }
  /// Calls lit(i, share) for every ray of which light is left; spends the packet.
  template <int kWidth, class Lit>
  void transmittance(RayPacket<kWidth>& rays, Passage passage, Lit&& lit) const {
    transmittance(tree_over_time(), rays, passage, ~0u, lit);
  }
  /// Some instances of the scene with nothing else; valid until the next take().
  class SubScene {
   public:
    SubScene(const EmbreeScene& scene, const std::vector<std::uint32_t>& instances);
    /// To its first surface; infinity where the ray misses it.
    float distance(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const;

   private:
    embree::SceneHandle tree_;
  };

 private:
  /// Ray masks of meshes; light sees all of them.
  static constexpr std::uint32_t kStaticMask = 1;
  static constexpr std::uint32_t kMovableMask = 2;

  /// An instance as Embree has it.
  struct Placed {
    std::shared_ptr<const ShadingMesh> mesh;
    bool is_movable = false;
    bool is_shared = false;                                ///< It uses the tree of its mesh.
    Eigen::Matrix3f linear = Eigen::Matrix3f::Identity();  ///< The pose that it has there.
    Vec3f translation = Vec3f::Zero();
    std::vector<float> positions;  ///< x, y, z per vertex in the world; empty if is_shared.
    bool lets_through = false;     ///< Rays, some or in part, by any of its materials.
    embree::GeometryHandle geometry;
  };
  /// The tree of a mesh that is used several times, in its own space.
  struct SharedTree {
    std::shared_ptr<const ShadingMesh> mesh;
    std::vector<float> positions;
    bool lets_through = false;
    embree::GeometryHandle geometry;
    embree::SceneHandle tree;
  };

  /// Carried by rays that look for a surface: what they left, by their ids, or null.
  struct MeetingContext {
    embree::Context context;
    const std::int32_t* left_instances = nullptr;
    const std::int32_t* left_triangles = nullptr;
  };

  /// Carried by shadow rays; the filter of the surfaces on their way attenuates what they carry.
  struct ShadowContext {
    embree::Context context;
    std::array<Vec3f, 16> transmittance;  ///< By the rays' ids; set when is_attenuated.
    bool is_attenuated = false;
    Passage passage = Passage::Glass;
    void attenuate(unsigned ray, const Vec3f& share) {
      if (!is_attenuated) transmittance.fill(Vec3f::Ones());
      is_attenuated = true;
      transmittance[ray] = transmittance[ray].cwiseProduct(share);
    }
  };

  static RTCRayHit make_ray(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max,
                            float time);
  void intersect(RTCScene tree, const BatchRays& rays, BatchHits& hits) const;
  void intersect(RTCScene tree, const BatchRays& rays, std::size_t begin, BatchHits& hits) const;
  RayHit intersect(RTCScene tree, const Vec3f& origin, const Vec3f& direction, float t_min,
                   float t_max, float time) const;
  template <int kWidth, class Lit>
  static void transmittance(RTCScene tree, RayPacket<kWidth>& rays, Passage passage,
                            std::uint32_t mask, Lit&& lit);
  RTCScene tree_over_time() const { return moving_tree_ ? moving_tree_.get() : tree_.get(); }
  /// What Embree tells of an instance's triangle is in the space of the mesh.
  static Vec3f normal_in_world(const MeshInstance& instance, const Vec3f& normal, float time);
  /// Of one of the rays that a filter is called for.
  static std::uint32_t number_of(const RTCFilterFunctionNArguments* args, unsigned i);
  static const MeshInstance& instance_of(const RTCFilterFunctionNArguments* args, unsigned i);
  static void pass_where_left_or_cut_out(const RTCFilterFunctionNArguments* args);
  static void attenuate_shadow_ray(const RTCFilterFunctionNArguments* args);
  bool is_shared(const MeshInstance& instance) const;
  void update_trees();
  void find_filters();
  void set_filters(RTCGeometry geometry, bool lets_through) const;
  void update_filters();
  void update_shared_trees();
  void forget_shared_trees();
  SharedTree make_shared_tree(std::shared_ptr<const ShadingMesh> mesh, bool lets_through) const;
  void commit(const SharedTree& shared) const;
  std::vector<std::size_t> changed_instances();
  void attach(const std::vector<std::size_t>& changed);
  void move_to_poses();
  embree::GeometryHandle new_geometry(const ShadingMesh& mesh) const;
  embree::GeometryHandle new_instance(const ShadingMesh& mesh) const;
  void blur();
  embree::GeometryHandle make_moving(std::uint32_t number);
  std::uint32_t sees(std::span<const CellGrid::Ray> rays) const;
  void check_device(const char* action) const;

  Host& host_;
  RenderScene scene_;
  embree::DeviceHandle device_;
  std::map<const ShadingMesh*, SharedTree> shared_trees_;
  std::vector<Placed> placed_;  ///< By the numbers of the instances, which are those of geometries.
  std::vector<std::uint8_t> lets_through_;  ///< By the numbers of the meshes.
  embree::SceneHandle tree_;
  /// Vertices of what moves in the shutter's window, at equal steps through it.
  std::vector<std::vector<float>> moving_positions_;
  embree::SceneHandle moving_tree_;  ///< tree_ with its motion; null when nothing moves.
  Times times_;
  bool is_ready_ = false;  ///< The last take() came to its end.
};

inline RTCRayHit EmbreeScene::make_ray(const Vec3f& origin, const Vec3f& direction, float t_min,
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

inline RayHit EmbreeScene::intersect(RTCScene tree, const Vec3f& origin, const Vec3f& direction,
                                     float t_min, float t_max, float time) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max, time);
  MeetingContext meeting;
  embree::init(meeting.context);
  embree::intersect(tree, meeting.context, ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const auto point = point_on_triangle(ray.hit.primID, ray.hit.u, ray.hit.v);
  const bool is_shared = ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
  const std::uint32_t number = is_shared ? ray.hit.instID[0] : ray.hit.geomID;
  const MeshInstance& instance = instances()[number];
  instance.shading->prefetch(point.triangle);
  const Vec3f normal(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z);
  return {&instance,      number,
          point.triangle, point.u,
          point.v,        ray.ray.tfar,
          time,           is_shared ? normal_in_world(instance, normal, time) : normal};
}

inline Vec3f EmbreeScene::transmittance(const Vec3f& origin, const Vec3f& direction, float t_max,
                                        Passage passage, float time) const {
  RTCRayHit ray = make_ray(origin, direction, 0.0f, t_max, time);
  ShadowContext shadow;
  shadow.passage = passage;
  embree::init(shadow.context);
  embree::occluded(tree_over_time(), shadow.context, ray.ray);
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
inline void RayPacket<kWidth>::load(const BatchRays& from, std::size_t begin) {
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
inline void RayPacket<kWidth>::pad(std::uint32_t mask) {
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

/// Those from `begin` on, as many as a packet takes.
inline void EmbreeScene::intersect(RTCScene tree, const BatchRays& from, std::size_t begin,
                                   BatchHits& hits) const {
  RayPacket8 packet;
  packet.load(from, begin);
  packet.pad(~0u);
  RTCRayHit8& rays = packet.rays_;
  MeetingContext meeting;
  embree::init(meeting.context);
  meeting.left_instances = &from.left_instance[begin];
  meeting.left_triangles = &from.left_triangle[begin];
  embree::intersect(packet.valid_.data(), tree, meeting.context, rays, from.is_coherent);
  for (std::size_t i = 0; i < RayPacket8::kSize; ++i) {
    const std::size_t to = begin + i;
    const bool is_met = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hits.number[to] = std::int32_t(rays.hit.geomID[i]);
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
    const unsigned shared = rays.hit.instID[0][i];
    const bool is_shared = shared != RTC_INVALID_GEOMETRY_ID;
    const MeshInstance& instance = instances()[is_shared ? shared : rays.hit.geomID[i]];
    hits.instance[to] = &instance;
    instance.shading->prefetch(std::uint32_t(hits.triangle[to]));
    if (!is_shared) continue;
    hits.number[to] = std::int32_t(shared);
    hits.normal.set(to, normal_in_world(instance, hits.normal.at(to), hits.time[to]));
  }
}

inline void EmbreeScene::intersect(RTCScene tree, const BatchRays& rays, BatchHits& hits) const {
  for (std::size_t begin = 0; begin < rays.count; begin += RayPacket8::kSize) {
    intersect(tree, rays, begin, hits);
  }
}

template <int kWidth, class Lit>
inline void EmbreeScene::transmittance(RTCScene tree, RayPacket<kWidth>& packet, Passage passage,
                                       std::uint32_t mask, Lit&& lit) {
  packet.pad(mask);
  ShadowContext shadow;
  shadow.passage = passage;
  embree::init(shadow.context);
  embree::occluded(packet.valid_.data(), tree, shadow.context, packet.rays_.ray);
  for (int i = 0; i < packet.count_; ++i) {
    if (packet.rays_.ray.tfar[i] == -kInfinite) continue;
    lit(i, shadow.is_attenuated ? shadow.transmittance[std::size_t(i)] : Vec3f(Vec3f::Ones()));
  }
}

inline Vec3f EmbreeScene::normal_in_world(const MeshInstance& instance, const Vec3f& normal,
                                          float time) {
  // The cofactors of the pose, so that its length stays that of twice the area.
  const Eigen::Matrix3f& m = instance.linear;
  Vec3f n = m.col(1).cross(m.col(2)) * normal.x() + m.col(2).cross(m.col(0)) * normal.y() +
            m.col(0).cross(m.col(1)) * normal.z();
  if (instance.motion) [[unlikely]]
    n = instance.motion->turned(n, time);
  return n;
}

}  // namespace diorama
