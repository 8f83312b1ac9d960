// SPDX-License-Identifier: Apache-2.0
#pragma once

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan.h>

namespace diorama {

// The functions that are used, found at run time: the plugin can be loaded, and say what is
// missing, where there is no Vulkan.
#define DIORAMA_VULKAN_INSTANCE_FUNCTIONS(DO)  \
  DO(vkDestroyInstance)                        \
  DO(vkEnumeratePhysicalDevices)               \
  DO(vkGetPhysicalDeviceProperties2)           \
  DO(vkGetPhysicalDeviceFeatures2)             \
  DO(vkGetPhysicalDeviceMemoryProperties)      \
  DO(vkGetPhysicalDeviceQueueFamilyProperties) \
  DO(vkEnumerateDeviceExtensionProperties)     \
  DO(vkCreateDevice)                           \
  DO(vkGetDeviceProcAddr)

#define DIORAMA_VULKAN_DEVICE_FUNCTIONS(DO) \
  DO(vkDestroyDevice)                       \
  DO(vkGetDeviceQueue)                      \
  DO(vkQueueSubmit)                         \
  DO(vkDeviceWaitIdle)                      \
  DO(vkCreateBuffer)                        \
  DO(vkDestroyBuffer)                       \
  DO(vkGetBufferMemoryRequirements)         \
  DO(vkGetBufferDeviceAddress)              \
  DO(vkAllocateMemory)                      \
  DO(vkFreeMemory)                          \
  DO(vkBindBufferMemory)                    \
  DO(vkMapMemory)                           \
  DO(vkCreateShaderModule)                  \
  DO(vkDestroyShaderModule)                 \
  DO(vkCreatePipelineLayout)                \
  DO(vkDestroyPipelineLayout)               \
  DO(vkCreateComputePipelines)              \
  DO(vkDestroyPipeline)                     \
  DO(vkCreateCommandPool)                   \
  DO(vkDestroyCommandPool)                  \
  DO(vkAllocateCommandBuffers)              \
  DO(vkResetCommandPool)                    \
  DO(vkBeginCommandBuffer)                  \
  DO(vkEndCommandBuffer)                    \
  DO(vkCmdBindPipeline)                     \
  DO(vkCmdPushConstants)                    \
  DO(vkCmdDispatch)                         \
  DO(vkCmdDispatchIndirect)                 \
  DO(vkCmdPipelineBarrier)                  \
  DO(vkCmdCopyBuffer)                       \
  DO(vkCmdFillBuffer)                       \
  DO(vkCreateFence)                         \
  DO(vkDestroyFence)                        \
  DO(vkResetFences)                         \
  DO(vkWaitForFences)                       \
  DO(vkCreateQueryPool)                     \
  DO(vkDestroyQueryPool)                    \
  DO(vkCmdResetQueryPool)                   \
  DO(vkCmdWriteTimestamp)                   \
  DO(vkGetQueryPoolResults)

// Null unless the device was opened for ray queries.
#define DIORAMA_VULKAN_RAY_QUERY_FUNCTIONS(DO)   \
  DO(vkCreateAccelerationStructureKHR)           \
  DO(vkDestroyAccelerationStructureKHR)          \
  DO(vkGetAccelerationStructureBuildSizesKHR)    \
  DO(vkGetAccelerationStructureDeviceAddressKHR) \
  DO(vkCmdBuildAccelerationStructuresKHR)

#define DIORAMA_DECLARE(NAME) PFN_##NAME NAME = nullptr;
struct VulkanInstanceFunctions {
  DIORAMA_VULKAN_INSTANCE_FUNCTIONS(DIORAMA_DECLARE)
};
struct VulkanDeviceFunctions {
  DIORAMA_VULKAN_DEVICE_FUNCTIONS(DIORAMA_DECLARE)
  DIORAMA_VULKAN_RAY_QUERY_FUNCTIONS(DIORAMA_DECLARE)
};
#undef DIORAMA_DECLARE

/// A structure that says what it is, as Vulkan wants them, and is zero but for that.
template <class Info>
Info vulkan_info(VkStructureType type) {
  Info info{};
  info.sType = type;
  return info;
}

}  // namespace diorama
