// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "diorama/host.h"
#include "diorama/image.h"
#include "gpu_world.h"
#include "renderer_support/film.h"
#include "renderer_support/path_settings.h"
#include "renderer_support/trace_job.h"
#include "renderer_support/view.h"
#include "vulkan_device.h"

namespace diorama {

/// What a device runs for light paths. Making it takes the driver a second or so.
struct PathKernels {
  explicit PathKernels(const VulkanDevice& device);

  VulkanKernel start;
  VulkanKernel arrange;
  VulkanKernel intersect;
  VulkanKernel shade;
  VulkanKernel shadow;
  VulkanKernel gather;
  /// How often a kernel may loop here: some drivers end loops silently.
  std::uint32_t iteration_limit;
};

/// A device that is ready to trace paths.
struct PathDevice {
  explicit PathDevice(int number) : device(number), kernels(device) {}

  VulkanDevice device;
  PathKernels kernels;
};

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

  /// Begins a picture.
  /// `window`: see RenderScene::window().
  void begin(const View& view, const PathSettings& settings, gpu::Address world, double window);
  /// Traces the samples of these jobs. Sums are the same for any division into jobs and passes.
  Counts trace(std::span<const TraceJob> jobs);
  /// The pixels' sums until now.
  Image<PixelSum> sums();

  /// Bytes on the device beside the scene.
  std::size_t working_bytes() const;

 private:
  /// Paths that are under way together.
  struct Pass {
    std::vector<gpu::SampleSlot> slots;
    std::vector<gpu::SlotRange> ranges;
    std::vector<SampleOrder> orders;  ///< Of the slots, where the processor makes the rays.
  };
  std::uint32_t slots_for_device() const;
  void make_room(std::uint32_t slots);
  void add(const TraceJob& job, std::uint32_t begin, std::uint32_t end, Pass& pass) const;
  void make_camera_rays(const Pass& pass);
  Counts trace(const Pass& pass);

  const VulkanDevice& device_;
  const PathKernels& kernels_;
  Host& host_;
  std::uint32_t most_slots_;

  const View* view_ = nullptr;  ///< Of the picture under way.
  double window_ = 0.0;
  gpu::Job job_;
  gpu::Push push_;
  VulkanBuffer job_buffer_;
  VulkanBuffer counters_;
  VulkanBuffer slots_;
  VulkanBuffer ranges_;
  VulkanBuffer columns_;  ///< State, results, hits, shadow rays and queues.
  VulkanBuffer camera_rays_;
  VulkanBuffer sums_;
};

}  // namespace diorama
