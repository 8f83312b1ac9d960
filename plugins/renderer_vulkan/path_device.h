// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "gpu_assets.h"
#include "vulkan_device.h"

namespace diorama {

/// Of the filter on planes, in the order of its steps.
struct PlaneKernels {
  explicit PlaneKernels(const VulkanDevice& device);

  VulkanKernel means;
  VulkanKernel chances;
  VulkanKernel read;
  VulkanKernel sums;
  VulkanKernel fireflies;
  VulkanKernel measure;
  VulkanKernel filter;
  VulkanKernel lost;
  VulkanKernel finish;
};

/// What a device runs for light paths. Making it takes the driver a second or so.
struct PathKernels {
  explicit PathKernels(const VulkanDevice& device);

  VulkanKernel start;
  VulkanKernel arrange;
  VulkanKernel intersect;
  VulkanKernel shade;
  VulkanKernel shadow;
  VulkanKernel gather;
  VulkanKernel resolve;
  PlaneKernels planes;
  /// How often a kernel may loop here: some drivers end loops silently.
  std::uint32_t iteration_limit;
};

/// A device that is ready to trace paths. Any thread may use it.
struct PathDevice {
  explicit PathDevice(int number)
      : device(number), kernels(device), assets(std::make_unique<GpuAssets>(device)) {}

  VulkanDevice device;
  PathKernels kernels;
  const std::unique_ptr<GpuAssets> assets;
};

/// The process's device of one of these numbers, that with the fewest users by now. It stays open
/// for users to come, unless it is lost. Throws as VulkanInstance::device() does for any of the
/// numbers. From any thread.
std::shared_ptr<const PathDevice> shared_path_device(std::span<const int> numbers);
inline std::shared_ptr<const PathDevice> shared_path_device(int number) {
  return shared_path_device(std::span(&number, 1));
}

}  // namespace diorama
