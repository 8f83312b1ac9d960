// SPDX-License-Identifier: Apache-2.0
#include "vulkan_instance.h"

#include <dlfcn.h>

#include <algorithm>
#include <string_view>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr std::uint32_t kApi = VK_API_VERSION_1_2;

std::string version_text(std::uint32_t version) {
  return std::to_string(VK_API_VERSION_MAJOR(version)) + "." +
         std::to_string(VK_API_VERSION_MINOR(version)) + "." +
         std::to_string(VK_API_VERSION_PATCH(version));
}

}  // namespace

std::string words_for(VkResult result) {
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "the driver is out of memory";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return "the device is out of memory";
    case VK_ERROR_DEVICE_LOST:
      return "the device was lost";
    case VK_ERROR_INITIALIZATION_FAILED:
      return "the driver does not start";
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return "there is no driver for any device of this machine";
    case VK_ERROR_TOO_MANY_OBJECTS:
      return "the driver has no room for more objects";
    default:
      return "error " + std::to_string(int(result));
  }
}

std::string description_of(const VulkanDeviceInfo& device) {
  std::string text = device.name + ", " + device.driver + ", Vulkan " + device.api + ", " +
                     std::to_string(device.memory >> 20) + " MiB" +
                     (device.has_ray_query ? ", ray queries" : "");
  for (std::size_t i = 0; i < device.missing.size(); ++i) {
    text += (i == 0 ? "; lacks " : ", ") + device.missing[i];
  }
  return text;
}

void VulkanInstance::Unload::operator()(void* library) const { dlclose(library); }

VulkanInstance::VulkanInstance(const char* loader)
    : library_(dlopen(loader, RTLD_NOW | RTLD_LOCAL)) {
  if (!library_) {
    throw Error(ErrorKind::Plugin,
                std::string("this machine has no Vulkan: ") + loader +
                    " is not there; install libvulkan1 and the driver of the device, or use the "
                    "renderer embree");
  }
  const auto find =
      reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library_.get(), "vkGetInstanceProcAddr"));
  const auto create =
      find ? reinterpret_cast<PFN_vkCreateInstance>(find(nullptr, "vkCreateInstance")) : nullptr;
  if (!create) {
    throw Error(ErrorKind::Plugin, std::string(loader) +
                                       " is no Vulkan loader: it has no "
                                       "vkCreateInstance");
  }
  auto application = vulkan_info<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "diorama";
  application.apiVersion = kApi;
  auto info = vulkan_info<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;
  const VkResult result = create(&info, nullptr, &instance_);
  if (result != VK_SUCCESS) {
    throw Error(ErrorKind::Plugin,
                "Vulkan does not start: " + words_for(result) +
                    "; install the driver of the device, or mesa-vulkan-drivers for one that "
                    "computes on the processor");
  }
#define DIORAMA_FIND(NAME) functions_.NAME = reinterpret_cast<PFN_##NAME>(find(instance_, #NAME));
  DIORAMA_VULKAN_INSTANCE_FUNCTIONS(DIORAMA_FIND)
#undef DIORAMA_FIND
  std::uint32_t count = 0;
  functions_.vkEnumeratePhysicalDevices(instance_, &count, nullptr);
  std::vector<VkPhysicalDevice> handles(count);
  functions_.vkEnumeratePhysicalDevices(instance_, &count, handles.data());
  handles.resize(count);
  for (const VkPhysicalDevice handle : handles) devices_.push_back(describe(handle));
  if (devices_.empty()) {
    functions_.vkDestroyInstance(instance_, nullptr);
    throw Error(ErrorKind::Plugin,
                "Vulkan finds no device: install the driver of the device, or "
                "mesa-vulkan-drivers for one that computes on the processor");
  }
}

const VulkanInstance& VulkanInstance::of_process() {
  static const VulkanInstance* const instance = new VulkanInstance();
  return *instance;
}

VulkanInstance::~VulkanInstance() { functions_.vkDestroyInstance(instance_, nullptr); }

VulkanDeviceInfo VulkanInstance::describe(VkPhysicalDevice handle) const {
  VulkanDeviceInfo info;
  info.handle = handle;
  auto properties12 = vulkan_info<VkPhysicalDeviceVulkan12Properties>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES);
  auto subgroups = vulkan_info<VkPhysicalDeviceSubgroupProperties>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES);
  auto properties =
      vulkan_info<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &subgroups;
  subgroups.pNext = &properties12;
  functions_.vkGetPhysicalDeviceProperties2(handle, &properties);
  const VkPhysicalDeviceProperties& plain = properties.properties;
  info.name = plain.deviceName;
  info.api = version_text(plain.apiVersion);
  info.most_groups = plain.limits.maxComputeWorkGroupCount[0];
  info.is_processor = plain.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  const bool is_known = plain.apiVersion >= kApi;
  info.driver = is_known ? std::string(properties12.driverName) + " " + properties12.driverInfo
                         : "driver " + version_text(plain.driverVersion);

  VkPhysicalDeviceMemoryProperties memory;
  functions_.vkGetPhysicalDeviceMemoryProperties(handle, &memory);
  for (std::uint32_t i = 0; i < memory.memoryHeapCount; ++i) {
    const VkMemoryHeap& heap = memory.memoryHeaps[i];
    if ((heap.flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0) {
      info.memory = std::max<std::uint64_t>(info.memory, heap.size);
    }
  }

  if (!is_known) {
    info.missing.push_back("Vulkan 1.2");
    return info;
  }
  auto features12 = vulkan_info<VkPhysicalDeviceVulkan12Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  auto features =
      vulkan_info<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &features12;
  functions_.vkGetPhysicalDeviceFeatures2(handle, &features);
  if (features12.bufferDeviceAddress == VK_FALSE) info.missing.push_back("bufferDeviceAddress");
  if (features12.scalarBlockLayout == VK_FALSE) info.missing.push_back("scalarBlockLayout");
  constexpr VkSubgroupFeatureFlags kOperations =
      VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT;
  if ((subgroups.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) == 0 ||
      (subgroups.supportedOperations & kOperations) != kOperations) {
    info.missing.push_back("ballots of subgroups in compute shaders");
  }

  describe_ray_queries(info);

  std::uint32_t count = 0;
  functions_.vkGetPhysicalDeviceQueueFamilyProperties(handle, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  functions_.vkGetPhysicalDeviceQueueFamilyProperties(handle, &count, families.data());
  const auto computes = [](const VkQueueFamilyProperties& family) {
    return (family.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0 && family.queueCount > 0;
  };
  const auto family = std::ranges::find_if(families, computes);
  if (family == families.end()) {
    info.missing.push_back("a queue for compute shaders");
  } else {
    info.queue_family = std::uint32_t(family - families.begin());
    if (family->timestampValidBits == 64) {
      info.nanoseconds_per_tick = double(plain.limits.timestampPeriod);
    }
  }
  return info;
}

void VulkanInstance::describe_ray_queries(VulkanDeviceInfo& info) const {
  std::uint32_t count = 0;
  functions_.vkEnumerateDeviceExtensionProperties(info.handle, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  functions_.vkEnumerateDeviceExtensionProperties(info.handle, nullptr, &count, extensions.data());
  const auto is_there = [&](std::string_view name) {
    return std::ranges::any_of(
        extensions, [&](const VkExtensionProperties& e) { return name == e.extensionName; });
  };
  if (!std::ranges::all_of(kRayQueryExtensions, is_there)) return;
  auto queries = vulkan_info<VkPhysicalDeviceRayQueryFeaturesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR);
  auto structures = vulkan_info<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
  structures.pNext = &queries;
  auto features =
      vulkan_info<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &structures;
  functions_.vkGetPhysicalDeviceFeatures2(info.handle, &features);
  info.has_ray_query = queries.rayQuery == VK_TRUE && structures.accelerationStructure == VK_TRUE;
  auto limits = vulkan_info<VkPhysicalDeviceAccelerationStructurePropertiesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR);
  auto properties =
      vulkan_info<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &limits;
  functions_.vkGetPhysicalDeviceProperties2(info.handle, &properties);
  info.most_query_triangles = limits.maxPrimitiveCount;
  info.most_query_instances = limits.maxInstanceCount;
  info.scratch_alignment =
      std::max<std::uint32_t>(1, limits.minAccelerationStructureScratchOffsetAlignment);
}

std::string VulkanInstance::list_of_devices() const {
  std::string text;
  for (std::size_t i = 0; i < devices_.size(); ++i) {
    text += (i == 0 ? "" : "; ") + std::to_string(i) + ": " + description_of(devices_[i]);
  }
  return text;
}

std::vector<int> VulkanInstance::able_devices() const {
  for (const bool is_processor : {false, true}) {
    std::vector<int> numbers;
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      const VulkanDeviceInfo& device = devices_[i];
      if (device.missing.empty() && device.is_processor == is_processor) numbers.push_back(int(i));
    }
    if (!numbers.empty()) return numbers;
  }
  throw Error(ErrorKind::Plugin,
              "devices: none can trace paths; this machine has " + list_of_devices());
}

const VulkanDeviceInfo& VulkanInstance::device(int number) const {
  if (number < 0 || std::size_t(number) >= devices_.size()) {
    throw Error(ErrorKind::Config, "device: there is no Vulkan device " + std::to_string(number) +
                                       "; this machine has " + list_of_devices());
  }
  const VulkanDeviceInfo& device = devices_[std::size_t(number)];
  if (!device.missing.empty()) {
    throw Error(ErrorKind::Plugin, "device: Vulkan device " + std::to_string(number) +
                                       " cannot trace paths; this machine has " +
                                       list_of_devices());
  }
  return device;
}

}  // namespace diorama
