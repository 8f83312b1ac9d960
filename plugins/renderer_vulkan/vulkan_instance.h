// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "vulkan_functions.h"

namespace diorama {

/// A device as the machine's Vulkan tells of it.
struct VulkanDeviceInfo {
  VkPhysicalDevice handle = VK_NULL_HANDLE;
  std::string name;
  std::string driver;                 ///< And its version.
  std::string api;                    ///< "1.3.230"
  bool is_processor = false;          ///< A driver that computes on the machine's processor.
  std::uint64_t memory = 0;           ///< Bytes of its largest heap of its own.
  std::uint32_t most_groups = 0;      ///< Of one dispatch.
  double nanoseconds_per_tick = 0.0;  ///< Of its clock; 0: it has none for kernels.
  std::uint32_t queue_family = 0;
  bool has_ray_query = false;  ///< Can find by itself what rays meet.
  // Of what ray queries go through:
  std::uint64_t most_query_triangles = 0;  ///< Of a mesh.
  std::uint64_t most_query_instances = 0;
  std::uint32_t scratch_alignment = 1;
  std::vector<std::string> missing;  ///< What path tracing needs and it does not have.
};

/// The machine's Vulkan, found at run time.
class VulkanInstance {
 public:
  /// Extensions that ray queries need.
  static constexpr std::array kRayQueryExtensions{VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                                  VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                                  VK_KHR_RAY_QUERY_EXTENSION_NAME};
  /// The one that all devices of the process come from; made when first asked for and never closed:
  /// drivers that are loaded again and again run out of room for their threads' variables.
  static const VulkanInstance& of_process();
  static constexpr const char* kLoader = "libvulkan.so.1";
  /// Throws Error(Plugin) where there is no loader or no driver.
  explicit VulkanInstance(const char* loader = kLoader);
  ~VulkanInstance();
  VulkanInstance(const VulkanInstance&) = delete;
  VulkanInstance& operator=(const VulkanInstance&) = delete;

  const std::vector<VulkanDeviceInfo>& devices() const { return devices_; }
  /// Throws Error(Config) where there is no such device, Error(Plugin) where it lacks something.
  const VulkanDeviceInfo& device(int number) const;
  /// Numbers of all that can trace paths; of processors only where there is nothing else.
  std::vector<int> able_devices() const;
  /// "0: ...; 1: ...", see description_of().
  std::string list_of_devices() const;
  const VulkanInstanceFunctions& functions() const { return functions_; }

 private:
  struct Unload {
    void operator()(void* library) const;
  };
  VulkanDeviceInfo describe(VkPhysicalDevice device) const;
  void describe_ray_queries(VulkanDeviceInfo& info) const;
  std::unique_ptr<void, Unload> library_;
  VulkanInstanceFunctions functions_;
  VkInstance instance_ = VK_NULL_HANDLE;
  std::vector<VulkanDeviceInfo> devices_;
};

/// One line: name, driver, memory, and what is missing.
std::string description_of(const VulkanDeviceInfo& device);

/// What a call's failure means, in words.
std::string words_for(VkResult result);

}  // namespace diorama
