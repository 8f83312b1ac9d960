// SPDX-License-Identifier: Apache-2.0
#include "path_device.h"

#include <kernels.h>  // made from shaders/

#include <algorithm>
#include <map>
#include <mutex>
#include <span>

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
      intersect(device, kernels::kIntersect),
      shade(device, kernels::kShade),
      shadow(device, kernels::kShadow),
      gather(device, kernels::kGather),
      resolve(device, kernels::kResolve),
      planes(device),
      iteration_limit(find_iteration_limit(device)) {}

std::shared_ptr<const PathDevice> shared_path_device(std::span<const int> numbers) {
  using Opened = std::map<int, std::shared_ptr<const PathDevice>>;
  static std::mutex mutex;
  // Never destroyed: at the end of the process drivers may be gone before.
  static Opened& opened = *new Opened;
  for (const int number : numbers) VulkanInstance::of_process().device(number);
  const std::lock_guard lock(mutex);
  const auto users = [](int number) {
    const std::shared_ptr<const PathDevice>& device = opened[number];
    return device ? device.use_count() - 1 : 0;
  };
  const int number = *std::ranges::min_element(numbers, {}, users);
  std::shared_ptr<const PathDevice>& device = opened[number];
  if (!device || device->device.is_lost()) device = std::make_shared<const PathDevice>(number);
  return device;
}

}  // namespace diorama
