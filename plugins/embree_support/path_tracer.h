// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "diorama/host.h"
#include "embree_scene.h"
#include "path_reuse.h"
#include "renderer_support/batch.h"
#include "renderer_support/film.h"
#include "renderer_support/hit_image.h"
#include "renderer_support/isa.h"
#include "renderer_support/learning_paths.h"
#include "renderer_support/path_settings.h"
#include "renderer_support/radiance_cache.h"
#include "renderer_support/trace_job.h"
#include "renderer_support/view.h"
#include "renderer_support/virtual_lights.h"

namespace diorama {

/// A ray that was traced.
struct LoggedRay {
  Vec3f origin;
  Vec3f direction;
  float t_min = 0.0f;
  float t_max = 0.0f;
  bool is_shadow = false;
};

struct TraceSettings : PathSettings {
  /// What the rays through the pixels' centres met, if known: every path then starts there. For
  /// views without aperture and shutter, and no more than a path per pixel.
  const HitImage* first_hits = nullptr;
  /// Where paths end that may; null: nowhere.
  const RadianceCache* cache = nullptr;
  /// That paths are connected with; null: none. Not where things move while the shutter is open.
  const VirtualLights* virtual_lights = nullptr;
  /// Asked after every batch of paths whether to stop.
  const Host* host = nullptr;
  /// For tests of the estimators: which of the two techniques that find light are used.
  bool samples_lights = true;
  bool samples_bsdf = true;
  /// For benchmarks: gets every ray, from one thread only.
  std::vector<LoggedRay>* ray_log = nullptr;
};

struct RayCounts {
  std::uint64_t rays = 0;
  std::uint64_t shadow_rays = 0;

  RayCounts& operator+=(const RayCounts& other) {
    rays += other.rays;
    shadow_rays += other.shadow_rays;
    return *this;
  }
};

/// Unidirectional path tracing with one light sample per vertex, weighted against what the BSDF
/// finds (multiple importance sampling). Const and shareable between threads.
class PathTracer {
 public:
  PathTracer(const EmbreeScene& scene, const View& view, const TraceSettings& settings, Isa isa);

  /// Adds samples to the sums of the job's pixels, which lie row by row from its first on, `stride`
  /// per row, and have their place() in the picture. Equal jobs give equal sums. Uses the kernel
  /// compiled for the instruction set.
  RayCounts trace(const TraceJob& job, PixelSum* sums, std::size_t stride) const {
    return trace(job, Output{sums, stride, nullptr});
  }
  /// Where in the picture a pixel of its jobs lies: elsewhere than these say where paths are
  /// reused. `order`: of the jobs.
  Pixel place(const SampleOrder& order, int x, int y) const;
  /// The means of a picture that these jobs are all of; paths that learnt are samples of it, too.
  /// Adds to `counts`.
  Film film(std::span<const TraceJob> jobs, Host& host, RayCounts& counts,
            const LearningPaths& learning = {}) const;
  /// The jobs' paths with what they find for those of the picture. Adds to `counts`.
  LearningPaths learn(std::span<const TraceJob> jobs, Host& host, RayCounts& counts) const;
  /// The light of lamps and sky that these places scatter, each by one light sample; dark ones have
  /// no irradiance. `key` and the numbers from `first` on name the random numbers.
  void light(std::span<const SurfaceParts::Point> places, std::uint32_t key, std::uint32_t first,
             std::span<VirtualLights::Light> lights, RayCounts& counts) const;

 private:
  /// Sums of pixels, or paths that learn.
  struct Output {
    PixelSum* sums;
    std::size_t stride;
    LearningPaths::Part* learning;
  };
  struct Path;
  struct StraightPass;
  struct Batch;

  RayCounts trace(const TraceJob& job, const Output& output) const;
  // Rays to lights are traced kPacketSize at a time.
  template <int kPacketSize>
  RayCounts trace_all(const TraceJob& job, const Output& output) const;
  RayCounts trace_sse42(const TraceJob& job, const Output& output) const;
  RayCounts trace_avx2(const TraceJob& job, const Output& output) const;
  RayCounts trace_avx512(const TraceJob& job, const Output& output) const;
  PixelPlaces places(const SampleOrder& order) const;
  void start_paths(std::vector<Path>& paths, Batch& v) const;
  template <int kPacketSize>
  void trace_batch(Batch& v) const;
  void open_shutter(Path& path, int row, CameraRay& ray) const;
  void find_surfaces(Batch& v) const;
  void log(const LoggedRay& ray) const;
  void trace_rays(Batch& v) const;
  void process_hits(Batch& v) const;
  /// Adds the light that the surface emits. False: the path is not scattered here.
  bool evaluate_material(Batch& v, std::size_t i) const;
  void draw_numbers(Batch& v) const;
  void take_lobes(Batch& v, std::size_t i) const;
  bool ends_at(const Path& path, const SurfaceBsdf& s) const;
  /// Ends the path with light from the cache, or begins what it finds for one.
  void use_cache(Batch& v, std::size_t i) const;
  static bool is_first_shared(const Batch& v, const Path& path, const SurfaceBsdf& s);
  static bool can_be_second(const SurfaceBsdf& s);
  static bool ends_for_others(const Batch& v, std::size_t i);
  /// Keeps it, if paths can reuse it.
  void share_surface(Batch& v, std::size_t i) const;
  template <int kPacketSize>
  void reuse_paths(std::vector<Path>& paths, Batch& v) const;
  void scatter(Batch& v, std::size_t i) const;
  /// How many virtual lights there are at a vertex, per square metre, if its path is connected.
  float rival_of_virtual_lights(const Batch& v, std::size_t i) const;
  /// What the light found at a vertex counts for, as virtual lights bring a part of it.
  float share_beside_virtual_lights(const Batch& v, std::size_t i) const;
  template <int kPacketSize>
  void connect(Batch& v) const;
  void place_on_surfaces(std::span<const SurfaceParts::Point> places, std::uint32_t key,
                         std::uint32_t first, std::vector<Path>& paths, Batch& v) const;
  void scatter_glass(Batch& v, std::size_t i) const;
  void light_glass(Batch& v, std::size_t i, const Bsdf& bsdf) const;
  void record_surface(const Batch& v, std::size_t i, const Vec3f& albedo) const;
  void take_light_samples(const Batch& v, std::size_t i) const;
  void queue_shadow_ray(Batch& v, std::size_t i) const;
  void go_on(Batch& v, std::size_t i, const BsdfSample& next, const Vec3f& origin,
             const Vec3f& direction, const LeftTriangle& behind = {}) const;
  static void sort_by_light(Batch& v);
  struct RaysFromVertices;
  template <int kPacketSize, class Lit>
  void trace_packets(Batch& v, const RaysFromVertices& rays, Passage passage, Lit&& lit) const;
  template <int kPacketSize>
  void trace_shadow_rays(Batch& v) const;
  void add_light_sample(const Batch& v, std::size_t i, const Vec3f& transmittance) const;
  void collect_lights(const Batch& v, std::size_t i) const;
  // `direction`: of the ray that met the surface.
  void collect_emission(Path& path, const Vec3f& direction, const RayHit& hit,
                        const SurfaceGeometry& surface, const ShadingMaterial& material) const;
  StraightPass pass_or_reflect(Path& path, const Vec3f& direction, const RayHit& hit,
                               const SurfaceGeometry& surface, const ShadingMaterial& material,
                               SurfaceBsdf& bsdf) const;
  void read_textures(const Path& path, const Vec3f& direction, const RayHit& hit,
                     const SurfaceGeometry& surface, const ShadingMaterial& material, bool is_soft,
                     SurfaceBsdf& bsdf, Vec3f& normal) const;
  /// `found`: how a path whose second surface is shared found it.
  void add(Path& path, int bounce, const Vec3f& radiance,
           Vec3f PathReuse::Found::*found = &PathReuse::Found::by_way_on) const;

  const EmbreeScene& scene_;
  const View& view_;
  TraceSettings settings_;
  Isa isa_;
};

}  // namespace diorama
