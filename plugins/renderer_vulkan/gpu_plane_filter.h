// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "diorama/host.h"
#include "diorama/image.h"
#include "gpu_path_tracer.h"
#include "gpu_world.h"
#include "path_device.h"

namespace diorama {

/// average_chances() and filtered_on_planes() of renderer_support on the device that traced the
/// paths, where the film stays: the same steps, so that pictures differ by rounding alone.
class GpuPlaneFilter {
 public:
  GpuPlaneFilter(const PathDevice& device, Host& host);

  /// The picture of the paths that `tracer` has traced. `view_position` as in DenoiseSettings;
  /// `firefly_limit` is what one path may bring, in units of white at the picture's own exposure;
  /// 0: no limit.
  Image<Vec3f> filtered(GpuPathTracer& tracer, const Vec3f& view_position, double firefly_limit);

  /// What the device was busy with for the last picture, in seconds by its clock; 0 where it has
  /// none.
  double device_seconds() const { return seconds_; }

 private:
  void make_room(int width, int height);
  float brightest_path(double firefly_limit) const;
  void record_rounds(VulkanCommands& commands);

  const VulkanDevice& device_;
  const PlaneKernels& kernels_;
  Host& host_;
  double seconds_ = 0.0;
  std::size_t pixels_ = 0;  ///< Of the picture under way.
  std::size_t blocks_ = 0;
  gpu::PlanePush push_;
  VulkanBuffer layers_;    ///< All that there is per pixel, and per block of pixels.
  VulkanBuffer film_;      ///< After the first step.
  VulkanBuffer for_host_;  ///< Means of blocks, then the picture.
};

}  // namespace diorama
