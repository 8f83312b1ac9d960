// SPDX-License-Identifier: Apache-2.0
#include "vulkan_device.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr std::size_t kTransferSize = std::size_t(8) << 20;
/// Of one submission.
constexpr std::uint32_t kMostMarks = 1023;

}  // namespace

VulkanBuffer::VulkanBuffer(const VulkanDevice& device, std::size_t size, Place place,
                           const char* what)
    : device_(&device), size_(std::max<std::size_t>(size, 16)) {
  const VulkanDeviceFunctions& vk = device.functions();
  auto info = vulkan_info<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = size_;
  info.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
               VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT |
               VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  if (device.traces_by_query()) {
    info.usage |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                  VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
  }
  const auto is_short = [](VkResult result) {
    return result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY;
  };
  const VkResult made = vk.vkCreateBuffer(device.handle(), &info, nullptr, &buffer_);
  if (is_short(made)) device.fail_for_memory(size_, what);
  device.check(made, "make a buffer");
  VkMemoryRequirements needs;
  vk.vkGetBufferMemoryRequirements(device.handle(), buffer_, &needs);
  auto flags = vulkan_info<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  auto allocation = vulkan_info<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  allocation.pNext = &flags;
  allocation.allocationSize = needs.size;
  constexpr VkMemoryPropertyFlags kMapped =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  allocation.memoryTypeIndex =
      place == Place::Device
          ? device.memory_type(needs.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT)
          : device.memory_type(needs.memoryTypeBits, kMapped,
                               place == Place::ToHost ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : 0);
  const VkResult result = vk.vkAllocateMemory(device.handle(), &allocation, nullptr, &memory_);
  if (result != VK_SUCCESS) {
    vk.vkDestroyBuffer(device.handle(), buffer_, nullptr);
    if (is_short(result)) device.fail_for_memory(size_, what);
    device.check(result, "allocate memory");
  }
  device.held_ += size_;
  // From here on the destructor would be needed: nothing throws any more but for bugs.
  device.check(vk.vkBindBufferMemory(device.handle(), buffer_, memory_, 0), "bind memory");
  auto address =
      vulkan_info<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
  address.buffer = buffer_;
  address_ = vk.vkGetBufferDeviceAddress(device.handle(), &address);
  if (place == Place::Device) return;
  void* data = nullptr;
  device.check(vk.vkMapMemory(device.handle(), memory_, 0, VK_WHOLE_SIZE, 0, &data), "map memory");
  data_ = static_cast<std::byte*>(data);
}

VulkanBuffer::~VulkanBuffer() {
  if (!device_) return;
  const VulkanDeviceFunctions& vk = device_->functions();
  vk.vkDestroyBuffer(device_->handle(), buffer_, nullptr);
  vk.vkFreeMemory(device_->handle(), memory_, nullptr);
  device_->held_ -= size_;
}

VulkanBuffer::VulkanBuffer(VulkanBuffer&& other) noexcept { *this = std::move(other); }

VulkanBuffer& VulkanBuffer::operator=(VulkanBuffer&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  std::swap(address_, other.address_);
  std::swap(data_, other.data_);
  return *this;
}

void VulkanBuffer::grow(const VulkanDevice& device, std::size_t size, Place place,
                        const char* what) {
  if (size_ >= size) return;
  // The old memory goes back first.
  *this = VulkanBuffer();
  *this = VulkanBuffer(device, size, place, what);
}

VulkanKernel::VulkanKernel(const VulkanDevice& device, std::span<const std::uint32_t> code)
    : device_(device) {
  const VulkanDeviceFunctions& vk = device.functions();
  auto info = vulkan_info<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  info.codeSize = code.size_bytes();
  info.pCode = code.data();
  VkShaderModule shader = VK_NULL_HANDLE;
  device.check(vk.vkCreateShaderModule(device.handle(), &info, nullptr, &shader), "load a kernel");
  auto pipeline =
      vulkan_info<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  pipeline.stage.module = shader;
  pipeline.stage.pName = "main";
  pipeline.layout = device.layout();
  const VkResult result = vk.vkCreateComputePipelines(device.handle(), VK_NULL_HANDLE, 1, &pipeline,
                                                      nullptr, &pipeline_);
  vk.vkDestroyShaderModule(device.handle(), shader, nullptr);
  device.check(result, "compile a kernel");
}

VulkanKernel::~VulkanKernel() {
  device_.functions().vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
}

VulkanCommands::VulkanCommands(const VulkanDevice& device, VkCommandBuffer commands,
                               VkQueryPool clock)
    : device_(device), commands_(commands), clock_(clock) {
  if (clock_ == VK_NULL_HANDLE) return;
  const VulkanDeviceFunctions& vk = device.functions();
  vk.vkCmdResetQueryPool(commands_, clock_, 0, kMostMarks + 1);
  vk.vkCmdWriteTimestamp(commands_, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, clock_, 0);
}

void VulkanCommands::mark(std::uint32_t what) {
  if (clock_ == VK_NULL_HANDLE || marks_.size() == kMostMarks) return;
  marks_.push_back(what);
  device_.functions().vkCmdWriteTimestamp(commands_, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, clock_,
                                          std::uint32_t(marks_.size()));
}

void VulkanCommands::push(const void* values, std::size_t size) {
  device_.functions().vkCmdPushConstants(commands_, device_.layout(), VK_SHADER_STAGE_COMPUTE_BIT,
                                         0, std::uint32_t(size), values);
}

void VulkanCommands::dispatch(const VulkanKernel& kernel, std::uint32_t groups) {
  const VulkanDeviceFunctions& vk = device_.functions();
  vk.vkCmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline());
  vk.vkCmdDispatch(commands_, groups, 1, 1);
}

void VulkanCommands::dispatch(const VulkanKernel& kernel, const VulkanBuffer& groups,
                              std::size_t offset) {
  const VulkanDeviceFunctions& vk = device_.functions();
  vk.vkCmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline());
  vk.vkCmdDispatchIndirect(commands_, groups.handle(), offset);
}

void VulkanCommands::copy(const VulkanBuffer& from, std::size_t from_offset, const VulkanBuffer& to,
                          std::size_t to_offset, std::size_t size) {
  const VkBufferCopy region{from_offset, to_offset, size};
  device_.functions().vkCmdCopyBuffer(commands_, from.handle(), to.handle(), 1, &region);
}

void VulkanCommands::zero(const VulkanBuffer& buffer, std::size_t size) {
  device_.functions().vkCmdFillBuffer(commands_, buffer.handle(), 0, size, 0);
}

void VulkanCommands::build(const VkAccelerationStructureBuildGeometryInfoKHR& info,
                           std::uint32_t count) {
  const VkAccelerationStructureBuildRangeInfoKHR range{count, 0, 0, 0};
  const VkAccelerationStructureBuildRangeInfoKHR* const ranges = &range;
  device_.functions().vkCmdBuildAccelerationStructuresKHR(commands_, 1, &info, &ranges);
  barrier();
}

void VulkanCommands::barrier() {
  VkPipelineStageFlags stages = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT |
                                VK_PIPELINE_STAGE_TRANSFER_BIT |
                                VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
  if (device_.traces_by_query()) stages |= VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
  auto memory = vulkan_info<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  memory.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  memory.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  device_.functions().vkCmdPipelineBarrier(commands_, stages, stages | VK_PIPELINE_STAGE_HOST_BIT,
                                           0, 1, &memory, 0, nullptr, 0, nullptr);
}

VulkanDevice::VulkanDevice(int number, bool traces_by_query)
    : instance_(VulkanInstance::of_process()),
      info_(instance_.device(number)),
      number_(number),
      traces_by_query_(traces_by_query) {
  const VulkanInstanceFunctions& vk = instance_.functions();
  vk.vkGetPhysicalDeviceMemoryProperties(info_.handle, &memory_);
  const float priority = 1.0f;
  auto queue = vulkan_info<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = info_.queue_family;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  auto features = vulkan_info<VkPhysicalDeviceVulkan12Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  features.bufferDeviceAddress = VK_TRUE;
  features.scalarBlockLayout = VK_TRUE;
  auto info = vulkan_info<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.pNext = &features;
  auto queries = vulkan_info<VkPhysicalDeviceRayQueryFeaturesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR);
  queries.rayQuery = VK_TRUE;
  auto structures = vulkan_info<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
  structures.accelerationStructure = VK_TRUE;
  if (traces_by_query) {
    features.pNext = &structures;
    structures.pNext = &queries;
    info.enabledExtensionCount = std::uint32_t(VulkanInstance::kRayQueryExtensions.size());
    info.ppEnabledExtensionNames = VulkanInstance::kRayQueryExtensions.data();
  }
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  check(vk.vkCreateDevice(info_.handle, &info, nullptr, &device_), "open the device");
#define DIORAMA_FIND(NAME) \
  functions_.NAME = reinterpret_cast<PFN_##NAME>(vk.vkGetDeviceProcAddr(device_, #NAME));
  DIORAMA_VULKAN_DEVICE_FUNCTIONS(DIORAMA_FIND)
  if (traces_by_query) {
    DIORAMA_VULKAN_RAY_QUERY_FUNCTIONS(DIORAMA_FIND)
  }
#undef DIORAMA_FIND
  try {
    make_layout();
    free_lanes_.push_back(make_lane());
  } catch (...) {
    destroy();
    throw;
  }
}

void VulkanDevice::make_layout() {
  functions_.vkGetDeviceQueue(device_, info_.queue_family, 0, &queue_);
  VkPushConstantRange constants{VK_SHADER_STAGE_COMPUTE_BIT, 0, kMostConstants};
  auto layout =
      vulkan_info<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &constants;
  check(functions_.vkCreatePipelineLayout(device_, &layout, nullptr, &layout_), "open the device");
}

std::unique_ptr<VulkanDevice::Lane> VulkanDevice::make_lane() const {
  constexpr const char* kAction = "make room for commands";
  auto lane = std::make_unique<Lane>();
  try {
    auto pool = vulkan_info<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = info_.queue_family;
    check(functions_.vkCreateCommandPool(device_, &pool, nullptr, &lane->pool), kAction);
    auto commands =
        vulkan_info<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    commands.commandPool = lane->pool;
    commands.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    commands.commandBufferCount = 1;
    check(functions_.vkAllocateCommandBuffers(device_, &commands, &lane->commands), kAction);
    auto fence = vulkan_info<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
    check(functions_.vkCreateFence(device_, &fence, nullptr, &lane->fence), kAction);
    if (info_.nanoseconds_per_tick > 0.0) {
      auto clock = vulkan_info<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
      clock.queryType = VK_QUERY_TYPE_TIMESTAMP;
      clock.queryCount = kMostMarks + 1;
      check(functions_.vkCreateQueryPool(device_, &clock, nullptr, &lane->clock), kAction);
    }
  } catch (...) {
    destroy(*lane);
    throw;
  }
  return lane;
}

void VulkanDevice::destroy(Lane& lane) const {
  functions_.vkDestroyQueryPool(device_, lane.clock, nullptr);
  functions_.vkDestroyFence(device_, lane.fence, nullptr);
  functions_.vkDestroyCommandPool(device_, lane.pool, nullptr);
}

/// Goes back to the device at the end of its life, also after an error.
class VulkanDevice::TakenLane {
 public:
  explicit TakenLane(const VulkanDevice& device) : device_(device) {
    {
      const std::lock_guard lock(device.lanes_mutex_);
      if (!device.free_lanes_.empty()) {
        lane_ = std::move(device.free_lanes_.back());
        device.free_lanes_.pop_back();
      }
    }
    if (!lane_) lane_ = device.make_lane();
  }
  ~TakenLane() {
    const std::lock_guard lock(device_.lanes_mutex_);
    device_.free_lanes_.push_back(std::move(lane_));
  }
  TakenLane(const TakenLane&) = delete;
  TakenLane& operator=(const TakenLane&) = delete;
  Lane& operator*() const { return *lane_; }

  /// Mapped memory for bytes on their way.
  const VulkanBuffer& transfers() const {
    if (lane_->transfers.size() == 0) {
      lane_->transfers =
          VulkanBuffer(device_, kTransferSize, VulkanBuffer::Place::ToHost, "transfers");
    }
    return lane_->transfers;
  }

 private:
  const VulkanDevice& device_;
  std::unique_ptr<Lane> lane_;
};

VulkanDevice::~VulkanDevice() { destroy(); }

void VulkanDevice::destroy() {
  functions_.vkDeviceWaitIdle(device_);
  for (const auto& lane : free_lanes_) destroy(*lane);
  free_lanes_.clear();
  functions_.vkDestroyPipelineLayout(device_, layout_, nullptr);
  functions_.vkDestroyDevice(device_, nullptr);
}

std::uint32_t VulkanDevice::memory_type(std::uint32_t allowed, VkMemoryPropertyFlags wanted,
                                        VkMemoryPropertyFlags liked) const {
  const auto find = [&](VkMemoryPropertyFlags flags) {
    for (std::uint32_t i = 0; i < memory_.memoryTypeCount; ++i) {
      const bool is_allowed = (allowed >> i & 1u) != 0;
      if (is_allowed && (memory_.memoryTypes[i].propertyFlags & flags) == flags) return i;
    }
    return memory_.memoryTypeCount;
  };
  const std::uint32_t best = find(wanted | liked);
  const std::uint32_t type = best < memory_.memoryTypeCount ? best : find(wanted);
  if (type < memory_.memoryTypeCount) return type;
  throw Error(ErrorKind::Plugin, "Vulkan device " + std::to_string(number_) + " (" + info_.name +
                                     ") has no memory that it shares with the processor");
}

void VulkanDevice::fail_for_memory(std::size_t size, const char* what) const {
  const auto mebibytes = [](std::uint64_t bytes) { return std::to_string((bytes >> 20) + 1); };
  throw Error(ErrorKind::Plugin,
              "Vulkan device " + std::to_string(number_) + " (" + info_.name +
                  ") has too little memory: " + mebibytes(size) + " MiB for " + what + " beside " +
                  mebibytes(held_) + " MiB that this job holds, of " +
                  std::to_string(info_.memory >> 20) +
                  " MiB that it has and may share with other programs; use another device, a "
                  "smaller scene or picture, or the renderer embree");
}

void VulkanDevice::check(VkResult result, const char* action) const {
  if (result == VK_SUCCESS) return;
  std::string text = "Vulkan device " + std::to_string(number_) + " (" + info_.name +
                     ") failed to " + action + ": " + words_for(result);
  if (result == VK_ERROR_DEVICE_LOST) {
    is_lost_ = true;
    text += "; the captures that were written stay: run the job again with --resume";
  }
  throw Error(ErrorKind::Plugin, text);
}

void VulkanDevice::run(const std::function<void(VulkanCommands&)>& record,
                       std::span<double> seconds) const {
  const TakenLane lane(*this);
  run(*lane, record, seconds);
}

void VulkanDevice::run(Lane& lane, const std::function<void(VulkanCommands&)>& record,
                       std::span<double> seconds) const {
  check(functions_.vkResetCommandPool(device_, lane.pool, 0), "take commands");
  auto begin = vulkan_info<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(functions_.vkBeginCommandBuffer(lane.commands, &begin), "take commands");
  VulkanCommands commands(*this, lane.commands, seconds.empty() ? VK_NULL_HANDLE : lane.clock);
  record(commands);
  // For the processor, which reads next.
  commands.barrier();
  check(functions_.vkEndCommandBuffer(lane.commands), "take commands");
  check(functions_.vkResetFences(device_, 1, &lane.fence), "take commands");
  auto submit = vulkan_info<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &lane.commands;
  {
    const std::lock_guard lock(queue_mutex_);
    check(functions_.vkQueueSubmit(queue_, 1, &submit, lane.fence), "run kernels");
  }
  check(functions_.vkWaitForFences(device_, 1, &lane.fence, VK_TRUE, ~std::uint64_t(0)),
        "run kernels");
  if (commands.marks().empty()) return;
  std::vector<std::uint64_t> ticks(commands.marks().size() + 1);
  check(functions_.vkGetQueryPoolResults(
            device_, lane.clock, 0, std::uint32_t(ticks.size()), ticks.size() * sizeof(ticks[0]),
            ticks.data(), sizeof(ticks[0]), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "read its clock");
  for (std::size_t i = 0; i < commands.marks().size(); ++i) {
    seconds[commands.marks()[i]] +=
        1e-9 * info_.nanoseconds_per_tick * double(ticks[i + 1] - ticks[i]);
  }
}

void VulkanDevice::upload(std::span<const Transfer> transfers) const {
  struct Copy {
    std::size_t from = 0;
    const VulkanBuffer* to = nullptr;
    std::size_t offset = 0;
    std::size_t size = 0;
  };
  const TakenLane lane(*this);
  const VulkanBuffer& buffer = lane.transfers();
  std::vector<Copy> copies;
  std::size_t filled = 0;
  const auto send = [&] {
    if (copies.empty()) return;
    const auto record = [&](VulkanCommands& commands) {
      for (const Copy& copy : copies) {
        commands.copy(buffer, copy.from, *copy.to, copy.offset, copy.size);
      }
    };
    run(*lane, record, {});
    copies.clear();
    filled = 0;
  };
  for (const Transfer& transfer : transfers) {
    for (std::size_t done = 0; done < transfer.bytes.size();) {
      if (filled == kTransferSize) send();
      const std::size_t size = std::min(kTransferSize - filled, transfer.bytes.size() - done);
      std::memcpy(buffer.data() + filled, transfer.bytes.data() + done, size);
      copies.push_back({filled, transfer.to, transfer.offset + done, size});
      filled += size;
      done += size;
    }
  }
  send();
}

void VulkanDevice::download(const VulkanBuffer& from, std::size_t offset,
                            std::span<std::byte> bytes) const {
  const TakenLane lane(*this);
  const VulkanBuffer& buffer = lane.transfers();
  for (std::size_t done = 0; done < bytes.size(); done += kTransferSize) {
    const std::size_t size = std::min(kTransferSize, bytes.size() - done);
    const auto record = [&](VulkanCommands& commands) {
      commands.copy(from, offset + done, buffer, 0, size);
    };
    run(*lane, record, {});
    std::memcpy(bytes.data() + done, buffer.data(), size);
  }
}

}  // namespace diorama
