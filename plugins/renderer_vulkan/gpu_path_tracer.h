// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/image.h"
#include "gpu_scene.h"
#include "gpu_world.h"
#include "path_device.h"
#include "renderer_support/film.h"
#include "renderer_support/learning_paths.h"
#include "renderer_support/path_settings.h"
#include "renderer_support/radiance_cache.h"
#include "renderer_support/trace_job.h"
#include "renderer_support/view.h"
#include "renderer_support/virtual_lights.h"

namespace diorama {

/// Light paths on a device. They advance together, kernel by kernel: rays, then what they met, then
/// rays to lights. What a path carries waits in columns between kernels, so that none loops longer
/// than one ray needs: some drivers end long loops silently.
class GpuPathTracer {
 public:
  /// `most_slots`: how many samples of 64 pixels are under way at most; 0: as the device has room.
  GpuPathTracer(const PathDevice& device, Host& host, std::uint32_t most_slots = 0);

  struct Counts {
    std::uint64_t rays = 0;
    std::uint64_t shadow_rays = 0;
  };

  /// Begins a picture. `cache`: where paths end that may; null: nowhere. `stays_connected`: with
  /// the virtual lights that paths were connected with before, which the device has. `scene` is
  /// used until the picture's last trace(). `window`: see RenderScene::window().
  void begin(const View& view, const PathSettings& settings, const GpuScene& scene, double window,
             const RadianceCache* cache = nullptr, bool stays_connected = false);
  /// Connects the paths of the jobs to come with these; to be called after begin(), and again for
  /// other lights on the same parts.
  void connect_with(const VirtualLights& lights);
  /// Traces the samples of these jobs. Sums are the same for any division into jobs and passes.
  Counts trace(std::span<const TraceJob> jobs);
  /// In place of a picture: the jobs' paths with what they find for those of pictures. Adds to
  /// `counts`.
  LearningPaths learn(std::span<const TraceJob> jobs, Counts& counts);
  /// Has the picture begun with these samples; to be called before its first trace().
  void count(const LearningPaths& paths);
  /// The pixels' sums until now.
  Image<PixelSum> sums();
  /// Their means.
  Film film();
  /// Has the device make the means without bringing them back; what is recorded next sees them, as
  /// FilmPixels at the address that it returns.
  gpu::Address record_film(VulkanCommands& commands) const;
  /// Of the picture.
  int width() const { return view_->camera().width; }
  int height() const { return view_->camera().height; }

  /// What the device was busy with since begin(), in seconds by its clock; nothing, where it has
  /// none.
  std::vector<std::pair<std::string, double>> device_seconds() const;

 private:
  /// What the device's clock is read for.
  enum Work : std::uint32_t {
    kTransfers,
    kBegin,
    kRays,
    kSurfaces,
    kShadowRays,
    kConnections,
    kSums,
    kWorkCount
  };
  /// Paths that are under way together.
  struct Pass {
    std::vector<gpu::SampleSlot> slots;
    std::vector<gpu::SlotRange> ranges;
    std::vector<SampleOrder> orders;  ///< Of the slots, where the processor makes the rays.
  };
  std::uint32_t slots_for_device() const;
  void make_room(std::uint32_t slots);
  void make_columns(std::size_t paths);
  void add(const TraceJob& job, std::uint32_t begin, std::uint32_t end, Pass& pass) const;
  void make_camera_rays(const Pass& pass);
  bool connects() const { return job_.part_triangles != 0; }
  bool learns() const { return job_.cache_use == gpu::kCacheLearns; }
  void read_learning_paths(const Pass& pass);
  void write_inputs(const Pass& pass);
  Counts trace(const Pass& pass);

  const VulkanDevice& device_;
  const PathKernels& kernels_;
  Host& host_;
  std::uint32_t most_slots_;

  // Of the picture under way:
  const View* view_ = nullptr;
  const RayKernels* rays_ = nullptr;
  const GpuScene* scene_ = nullptr;
  double window_ = 0.0;
  bool has_sums_ = false;
  LearningPaths learning_;  ///< Where it learns.

  gpu::Job job_;
  gpu::Push push_;
  std::array<double, kWorkCount> seconds_{};
  VulkanBuffer counters_;
  VulkanBuffer inputs_;   ///< The job, the slots and their ranges.
  VulkanBuffer columns_;  ///< State, results, hits, shadow rays and queues.
  VulkanBuffer camera_rays_;
  VulkanBuffer connections_;
  VulkanBuffer cache_;
  VulkanBuffer parts_;  ///< Of surfaces, where paths are connected with virtual lights ...
  VulkanBuffer virtual_lights_;
  VulkanBuffer device_findings_;
  VulkanBuffer sums_;
  VulkanBuffer film_;
  VulkanBuffer inputs_from_host_;
  VulkanBuffer results_for_host_;  ///< Counters, and the film.
};

}  // namespace diorama
