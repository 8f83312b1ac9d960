// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
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

/// They find what rays meet.
struct RayKernels {
  RayKernels(const VulkanDevice& device, std::span<const std::uint32_t> intersect_code,
             std::span<const std::uint32_t> shadow_code)
      : intersect(device, intersect_code), shadow(device, shadow_code) {}

  VulkanKernel intersect;
  VulkanKernel shadow;
};

/// What a device runs for light paths. Making it takes the driver a second or so.
struct PathKernels {
  explicit PathKernels(const VulkanDevice& device);

  VulkanKernel start;
  VulkanKernel arrange;
  RayKernels by_trees;
  std::optional<RayKernels> by_query;  ///< Where the device is opened for ray queries.
  VulkanKernel shade;
  VulkanKernel shade_with_virtual_lights;
  VulkanKernel gather;
  VulkanKernel resolve;
  PlaneKernels planes;
  /// How often a kernel may loop here: some drivers end loops silently.
  std::uint32_t iteration_limit;
};

/// A device that is ready to trace paths. Any thread may use it.
struct PathDevice {
  PathDevice(int number, bool traces_by_query)
      : device(number, traces_by_query),
        kernels(device),
        assets(std::make_unique<GpuAssets>(device)) {}

  VulkanDevice device;
  PathKernels kernels;
  const std::unique_ptr<GpuAssets> assets;
};

/// The process's device of one of these numbers, that with the fewest users by now. It stays open
/// for users to come, unless it is lost. Throws as VulkanInstance::device() does for any of the
/// numbers, or Error(Config) where one of them has no ray queries and `traces_by_query` asks for
/// them. From any thread.
std::shared_ptr<const PathDevice> shared_path_device(std::span<const int> numbers,
                                                     bool traces_by_query = false);
inline std::shared_ptr<const PathDevice> shared_path_device(int number,
                                                            bool traces_by_query = false) {
  return shared_path_device(std::span(&number, 1), traces_by_query);
}

}  // namespace diorama
