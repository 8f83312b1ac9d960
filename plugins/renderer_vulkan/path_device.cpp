// SPDX-License-Identifier: Apache-2.0
#include "path_device.h"

#include <kernels.h>  // made from shaders/

#include <algorithm>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>

#include "diorama/error.h"
#include "gpu_world.h"

namespace diorama {
namespace {

/// Lavapipe of Mesa 22.3 ends all loops of a kernel's run after 65,535 rounds, without an error.
std::uint32_t find_iteration_limit(const VulkanDevice& device) {
  constexpr std::uint32_t kWanted = 200'000;
  struct Constants {
    gpu::Address counted;
    std::uint32_t wanted = kWanted;
    std::uint32_t pad = 0;
  };
  const VulkanKernel kernel(device, kernels::kLimits);
  const VulkanBuffer counted(device, sizeof(std::uint32_t), VulkanBuffer::Place::Device, "a test");
  device.run([&](VulkanCommands& commands) {
    commands.constants(Constants{counted.address()});
    commands.dispatch(kernel, 1);
  });
  std::uint32_t found = 0;
  device.download(counted, 0, std::as_writable_bytes(std::span(&found, 1)));
  constexpr std::uint32_t kSpare = 512;  // of a kernel's other loops
  return found == kWanted ? 0xFFFFFFFFu : found - std::min(found, kSpare);
}

}  // namespace

PlaneKernels::PlaneKernels(const VulkanDevice& device)
    : means(device, kernels::kPlaneMeans),
      chances(device, kernels::kPlaneChances),
      read(device, kernels::kPlaneRead),
      sums(device, kernels::kPlaneSums),
      fireflies(device, kernels::kPlaneFireflies),
      measure(device, kernels::kPlaneMeasure),
      filter(device, kernels::kPlaneFilter),
      lost(device, kernels::kPlaneLost),
      finish(device, kernels::kPlaneFinish) {}

PathKernels::PathKernels(const VulkanDevice& device)
    : start(device, kernels::kStart),
      arrange(device, kernels::kArrange),
      by_trees(device, kernels::kIntersect, kernels::kShadow),
      shade(device, kernels::kShade),
      shade_with_virtual_lights(device, kernels::kShadeWithVirtualLights),
      gather(device, kernels::kGather),
      resolve(device, kernels::kResolve),
      planes(device),
      iteration_limit(find_iteration_limit(device)) {
  if (device.traces_by_query()) {
    by_query.emplace(device, kernels::kIntersectByQuery, kernels::kShadowByQuery);
  }
}

std::shared_ptr<const PathDevice> shared_path_device(std::span<const int> numbers,
                                                     bool traces_by_query) {
  using Opened = std::map<std::pair<int, bool>, std::shared_ptr<const PathDevice>>;
  static std::mutex mutex;
  // Never destroyed: at the end of the process drivers may be gone before.
  static Opened& opened = *new Opened;
  for (const int number : numbers) {
    const VulkanDeviceInfo& info = VulkanInstance::of_process().device(number);
    if (traces_by_query && !info.has_ray_query) {
      throw Error(ErrorKind::Config, "ray_query: Vulkan device " + std::to_string(number) + " (" +
                                         description_of(info) +
                                         ") has no ray queries; leave ray_query out");
    }
  }
  const std::lock_guard lock(mutex);
  const auto users = [&](int number) {
    const std::shared_ptr<const PathDevice>& device = opened[{number, traces_by_query}];
    return device ? device.use_count() - 1 : 0;
  };
  const int number = *std::ranges::min_element(numbers, {}, users);
  std::shared_ptr<const PathDevice>& device = opened[{number, traces_by_query}];
  if (!device || device->device.is_lost()) {
    device = std::make_shared<const PathDevice>(number, traces_by_query);
  }
  return device;
}

}  // namespace diorama
