// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "channels.h"
#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/renderer.h"
#include "embree_scene.h"
#include "renderer_support/denoiser.h"
#include "renderer_support/hit_image.h"
#include "renderer_support/isa.h"
#include "renderer_support/path_settings.h"
#include "renderer_support/sample_plan.h"
#include "renderer_support/spare_pages.h"

namespace diorama {

/// What jobs say of pictures made of light paths, whatever traces these.
struct PictureParams {
  std::string mode = "path_traced";
  int samples = 32;
  double error_target = 0.0;
  double time_budget_s = 0.0;
  int max_bounces = 6;
  bool denoise = true;
  std::string denoiser = "own";  ///< A parameter only where the build found another one.
  bool caustics = false;
  double clamp = 0.0;
  bool radiance_cache = true;
  bool virtual_lights = true;
  bool path_reuse = true;
  double firefly_limit = 4.0;
  std::string exposure = "auto";
  double exposure_ev = 0.0;
  std::string view_transform = "filmic";
  std::string sphere_lights = "sphere";
  std::string principled = "layered";
  std::string isa = best_isa_name();  ///< So that the dataset names it.

  void visit(ParamVisitor& v);
};

/// A path tracer but for its paths: what it makes of them, and labels, which Embree's rays find.
/// Labels of all renderers derived from it are therefore the same bytes.
class PathRenderer : public Renderer {
 public:
  NameSet provides() const override;
  /// Phases of the preparation, and once a picture was rendered those of the picture.
  RenderReport report() const override;

  /// What the last render() did; for benchmarks.
  struct Counts {
    std::uint64_t paths = 0;
    std::uint64_t rays = 0;
    std::uint64_t shadow_rays = 0;
    double trace_s = 0.0;  ///< Wall time.
    double denoise_s = 0.0;
    double channels_s = 0.0;
    /// What the device that traced the paths was busy with, by its own clock, if it has one.
    std::vector<std::pair<std::string, double>> device_s;
  };
  const Counts& last_counts() const { return counts_; }

 protected:
  PathRenderer(PictureParams params, Host& host);

  /// A picture's light paths.
  virtual Film trace(const View& view, const PathSettings& settings, SamplePlan& plan) = 0;
  /// Whether trace() leaves the processor idle and asks for no first hits: labels are then made
  /// while it runs on a thread of its own.
  virtual bool traces_elsewhere() const { return false; }
  /// Whether trace() lets paths use others' surfaces; see PathSettings.
  virtual bool can_reuse_paths() const { return false; }
  /// Whether trace_quickly() is to be called for quick modes.
  virtual bool filters_elsewhere() const { return false; }
  /// What the filter on planes (plane_filter.h) makes of a picture's light paths, where that is not
  /// done here. `firefly_limit`: that of the parameters. Counts its own time.
  virtual Image<Vec3f> trace_quickly(const View& view, const PathSettings& settings,
                                     SamplePlan& plan, double firefly_limit);
  /// Memory that trace() holds beside the film of so many pixels.
  virtual std::size_t traced_bytes(std::size_t pixels) const = 0;
  /// Called after the scene was taken in.
  virtual void prepare_paths() {}

  bool has_virtual_lights() const {
    return params_.virtual_lights && !is_quick() && params_.max_bounces > 0;
  }
  int samples() const { return params_.samples; }
  bool has_rounds() const { return params_.error_target > 0.0 || params_.time_budget_s > 0.0; }
  /// What the rays through the pixels' centres met, for pictures whose paths all start there.
  const HitImage& first_hits(const View& view);
  Host& host() { return host_; }
  Isa isa() const { return isa_; }
  const EmbreeScene& meshes() const { return meshes_; }
  Counts& counts() { return counts_; }

 private:
  void do_prepare(const Scene& scene) override;
  Frame do_render(const Scene& scene, const RenderRequest& request) override;
  std::vector<CoverageMask> do_cover(const Scene& scene, NodeId camera,
                                     std::span<const LabelledInstance> instances,
                                     bool with_distances) override;
  std::vector<std::uint8_t> do_see(const Scene& scene, NodeId camera,
                                   std::span<const Vec3> points_world) override;
  std::size_t working_bytes(const Camera& camera, const NameSet& channels) const override;
  const SeenMeshes& seen(const View& view, NodeId camera);
  bool starts_at_centres(const View& view) const;
  PathSettings path_settings(const View& view) const;
  Image<Vec3f> without_noise(Film film, const View& view);
  /// With one bounce the second surface is the last one: its light sample finds all.
  bool ends_in_cache() const {
    return params_.radiance_cache && params_.denoise && !is_quick() && params_.max_bounces > 1;
  }
  bool is_quick() const { return params_.mode != "path_traced"; }
  bool filters_film_elsewhere() const {
    return filters_elsewhere() && is_quick() && params_.denoiser == "own";
  }
  Image<Vec3f> light(const View& view, std::uint64_t seed);
  void put_colors(Frame& frame, const RenderRequest& request, Image<Vec3f> hdr);

  std::shared_ptr<SparePages> spare_pages_ = SparePages::shared();
  PictureParams params_;
  Host& host_;
  Isa isa_;
  EmbreeScene meshes_;
  Counts counts_;
  NodeId rendered_by_;  ///< The camera of the picture under way.
  NodeId seen_by_;      ///< The camera of `seen_`, if there is any.
  SeenMeshes seen_;
  HitImage first_hits_;  ///< Of the picture under way, if its paths start there.
};

}  // namespace diorama
