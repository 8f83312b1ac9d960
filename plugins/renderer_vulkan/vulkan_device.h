// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "vulkan_instance.h"

namespace diorama {

class VulkanDevice;

/// Memory that kernels address. Belongs to a device, which outlives it.
class VulkanBuffer {
 public:
  enum class Place : std::uint8_t {
    Device,    ///< Kernels read and write it fast.
    ToDevice,  ///< The processor writes it.
    ToHost,    ///< The processor reads it.
  };
  VulkanBuffer() = default;
  /// `what` is for the message where there is too little memory.
  VulkanBuffer(const VulkanDevice& device, std::size_t size, Place place, const char* what);
  ~VulkanBuffer();
  VulkanBuffer(VulkanBuffer&& other) noexcept;
  VulkanBuffer& operator=(VulkanBuffer&& other) noexcept;

  /// Makes it anew where it is smaller than that; what it held is gone then.
  void grow(const VulkanDevice& device, std::size_t size, Place place, const char* what);

  std::size_t size() const { return size_; }
  VkBuffer handle() const { return buffer_; }
  VkDeviceAddress address() const { return address_; }
  std::byte* data() const { return data_; }  ///< Null on the device.

 private:
  const VulkanDevice* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::size_t size_ = 0;
  VkDeviceAddress address_ = 0;
  std::byte* data_ = nullptr;
};

/// A compiled shader whose only input are its push constants.
class VulkanKernel {
 public:
  VulkanKernel(const VulkanDevice& device, std::span<const std::uint32_t> code);
  ~VulkanKernel();
  VulkanKernel(const VulkanKernel&) = delete;
  VulkanKernel& operator=(const VulkanKernel&) = delete;
  VkPipeline pipeline() const { return pipeline_; }

 private:
  const VulkanDevice& device_;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

/// Commands under way to the device.
class VulkanCommands {
 public:
  /// `clock`: null: none is wanted.
  VulkanCommands(const VulkanDevice& device, VkCommandBuffer commands, VkQueryPool clock);

  /// Constants must fit VulkanDevice::kMostConstants.
  template <class Constants>
  void constants(const Constants& values) {
    push(&values, sizeof(values));
  }
  void dispatch(const VulkanKernel& kernel, std::uint32_t groups);
  /// The numbers of groups are read from the buffer.
  void dispatch(const VulkanKernel& kernel, const VulkanBuffer& groups, std::size_t offset);
  void copy(const VulkanBuffer& from, std::size_t from_offset, const VulkanBuffer& to,
            std::size_t to_offset, std::size_t size);
  void zero(const VulkanBuffer& buffer, std::size_t size);
  /// Of one geometry, with `count` triangles or instances; what comes after sees it.
  void build(const VkAccelerationStructureBuildGeometryInfoKHR& info, std::uint32_t count);
  /// What comes after sees what came before.
  void barrier();
  /// Counts the time since the last mark for `what`; see VulkanDevice::run().
  void mark(std::uint32_t what);
  /// What the marks were for, in their order.
  const std::vector<std::uint32_t>& marks() const { return marks_; }

 private:
  void push(const void* values, std::size_t size);
  const VulkanDevice& device_;
  VkCommandBuffer commands_;
  VkQueryPool clock_;
  std::vector<std::uint32_t> marks_;
};

/// A device of the machine with one queue. Any thread may use it: each has a lane of its own.
class VulkanDevice {
 public:
  static constexpr std::size_t kMostConstants = 128;

  /// `traces_by_query`: for ray queries, which the device must have.
  explicit VulkanDevice(int number, bool traces_by_query = false);
  ~VulkanDevice();
  VulkanDevice(const VulkanDevice&) = delete;
  VulkanDevice& operator=(const VulkanDevice&) = delete;

  const VulkanInstance& instance() const { return instance_; }
  const VulkanDeviceInfo& info() const { return info_; }
  const VulkanDeviceFunctions& functions() const { return functions_; }
  int number() const { return number_; }
  bool traces_by_query() const { return traces_by_query_; }
  VkDevice handle() const { return device_; }
  VkPipelineLayout layout() const { return layout_; }
  /// Some call found that the device is lost: nothing that is on it can be used any more.
  bool is_lost() const { return is_lost_; }
  /// Bytes that buffers hold now.
  std::uint64_t held() const { return held_; }

  /// Records and runs commands, and waits until they are done. `seconds`: by what was marked, the
  /// time that it took is added; where the device has no clock, nothing is.
  void run(const std::function<void(VulkanCommands&)>& record,
           std::span<double> seconds = {}) const;
  /// Bytes for a buffer on the device.
  struct Transfer {
    std::span<const std::byte> bytes;
    const VulkanBuffer* to = nullptr;
    std::size_t offset = 0;
  };
  void upload(std::span<const Transfer> transfers) const;
  void upload(std::span<const std::byte> bytes, const VulkanBuffer& to, std::size_t offset) const {
    const Transfer transfer{bytes, &to, offset};
    upload(std::span(&transfer, 1));
  }
  /// And back.
  void download(const VulkanBuffer& from, std::size_t offset, std::span<std::byte> bytes) const;

  /// Throws unless the call went well. `action`: "run a kernel".
  void check(VkResult result, const char* action) const;

 private:
  friend class VulkanBuffer;
  /// What a thread records and waits with; used by one at a time.
  struct Lane {
    VkCommandPool pool = VK_NULL_HANDLE;
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkFence fence = VK_NULL_HANDLE;
    VkQueryPool clock = VK_NULL_HANDLE;
    VulkanBuffer transfers;  ///< Made when first needed.
  };
  class TakenLane;
  std::unique_ptr<Lane> make_lane() const;
  void destroy(Lane& lane) const;
  void run(Lane& lane, const std::function<void(VulkanCommands&)>& record,
           std::span<double> seconds) const;
  std::uint32_t memory_type(std::uint32_t allowed, VkMemoryPropertyFlags wanted,
                            VkMemoryPropertyFlags liked) const;
  [[noreturn]] void fail_for_memory(std::size_t size, const char* what) const;
  void make_layout();
  void destroy();

  const VulkanInstance& instance_;
  const VulkanDeviceInfo& info_;
  int number_;
  bool traces_by_query_;
  VulkanDeviceFunctions functions_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPhysicalDeviceMemoryProperties memory_{};
  mutable std::atomic<std::uint64_t> held_ = 0;
  mutable std::atomic<bool> is_lost_ = false;
  mutable std::mutex queue_mutex_;
  mutable std::mutex lanes_mutex_;
  mutable std::vector<std::unique_ptr<Lane>> free_lanes_;
};

}  // namespace diorama
