// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "channels.h"
#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/renderer.h"
#include "embree_scene.h"
#include "path_tracer.h"
#include "renderer_support/denoiser.h"
#include "renderer_support/sample_plan.h"

namespace diorama {

/// The project's own path tracer; see README.md beside this file.
class EmbreeRenderer final : public Renderer {
 public:
  struct Params {
    std::string mode = "path_traced";
    int samples = 32;
    double error_target = 0.0;
    double time_budget_s = 0.0;
    int max_bounces = 6;
    bool denoise = true;
    std::string denoiser = "own";  ///< A parameter only where the build found another one.
    bool caustics = false;
    double clamp = 0.0;
    double firefly_limit = 4.0;
    std::string exposure = "auto";
    double exposure_ev = 0.0;
    std::string view_transform = "filmic";
    std::string sphere_lights = "sphere";
    std::string principled = "layered";
    std::string isa = best_isa_name();  ///< So that the dataset names it.

    void visit(ParamVisitor& v);
  };

  EmbreeRenderer(Params params, Host& host);
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
  };
  const Counts& last_counts() const { return counts_; }

 private:
  void do_prepare(const Scene& scene) override;
  Frame do_render(const Scene& scene, const RenderRequest& request) override;
  std::vector<CoverageMask> do_cover(const Scene& scene, NodeId camera,
                                     std::span<const LabelledInstance> instances,
                                     bool with_distances) override;
  std::size_t working_bytes(const Camera& camera, const NameSet& channels) const override;
  const SeenMeshes& seen(const View& view, NodeId camera);
  bool starts_at_centres(const View& view) const;
  Film trace(const View& view, NodeId camera, std::uint64_t seed);
  Film trace_at_once(const PathTracer& tracer, SamplePlan& plan, int width, int height);
  Film trace_in_rounds(const PathTracer& tracer, SamplePlan& plan, int width, int height);
  Image<Vec3f> without_noise(Film film, const View& view);
  bool is_quick() const { return params_.mode != "path_traced"; }
  void put_colors(Frame& frame, const RenderRequest& request, const View& view);

  Params params_;
  Host& host_;
  Isa isa_;
  EmbreeScene meshes_;
  Counts counts_;
  NodeId seen_by_;  ///< The camera of `seen_`, if there is any.
  SeenMeshes seen_;
  Image<RayHit> first_hits_;  ///< Of the picture under way, if its paths start there.
};

}  // namespace diorama
