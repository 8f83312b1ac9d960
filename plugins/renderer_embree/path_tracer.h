// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "render_scene.h"
#include "sobol.h"
#include "view.h"

namespace diorama {

struct TraceSettings {
  int max_bounces = 6;  ///< Surfaces after the first that may scatter light.
  float clamp = 0.0f;   ///< Largest luminance of one indirect contribution; 0: no limit.
  /// True: light focused by glass and mirrors is searched by chance, and glass blocks shadow rays.
  /// False: shadow rays pass glass straight, and lights seen over a diffuse surface through a
  /// mirror or glass are left out: far less noise for a little lost light.
  bool has_caustics = false;
  /// For tests of the estimators: which of the two techniques that find light are used.
  bool samples_lights = true;
  bool samples_bsdf = true;
};

/// One light path of a pixel.
struct PathSample {
  Vec3f seen = Vec3f::Zero();       ///< Light sources seen directly or in mirrors: free of noise.
  Vec3f scattered = Vec3f::Zero();  ///< All other radiance.
  // The first surface that scatters; zero when there was none.
  Vec3f albedo = Vec3f::Zero();  ///< Share of uniform light that it returns.
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  bool has_surface = false;
  std::uint32_t rays = 0;
  std::uint32_t shadow_rays = 0;
};

/// Unidirectional path tracing with one light sample per vertex, weighted against what the BSDF
/// finds (multiple importance sampling). Const and shareable between threads.
class PathTracer {
 public:
  PathTracer(const RenderScene& scene, const View& view, const SobolTable& table,
             const TraceSettings& settings);

  /// Sample `index` of a pixel; equal arguments give equal results.
  PathSample trace(int x, int y, std::uint32_t index, std::uint64_t seed) const;

 private:
  struct Path;

  void collect_lights(Path& path, float t_max) const;
  void collect_emission(Path& path, const RayHit& hit, const SurfaceGeometry& surface,
                        const ShadingMaterial& material) const;
  /// True: the surface let the path through or ended it.
  bool pass_or_reflect(Path& path, const SurfaceGeometry& surface, const ShadingMaterial& material,
                       SurfaceBsdf& bsdf) const;
  void sample_light(Path& path, const SurfaceGeometry& surface, const Bsdf& bsdf,
                    const Basis& basis) const;
  void scatter(Path& path, const RayHit& hit, const SurfaceGeometry& surface,
               const ShadingMaterial& material) const;
  void add(Path& path, const Vec3f& radiance) const;

  const RenderScene& scene_;
  const View& view_;
  const SobolTable& table_;
  TraceSettings settings_;
};

/// Base colour of a surface point with textures and vertex colours, linear.
Vec3f base_color_at(const RayHit& hit, const SurfaceGeometry& surface, float uv_footprint);

}  // namespace diorama
