// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "vulkan_device.h"

namespace diorama {

class VulkanArena;

/// A part of an arena's memory, given back at the end of its life. The arena outlives it.
class VulkanRange {
 public:
  VulkanRange() = default;
  ~VulkanRange();
  VulkanRange(VulkanRange&& other) noexcept { *this = std::move(other); }
  VulkanRange& operator=(VulkanRange&& other) noexcept;

  const VulkanBuffer& buffer() const { return *buffer_; }
  std::size_t offset() const { return offset_; }
  VkDeviceAddress address() const { return buffer_->address() + offset_; }

 private:
  friend class VulkanArena;
  VulkanArena* arena_ = nullptr;
  const VulkanBuffer* buffer_ = nullptr;
  std::size_t offset_ = 0;
  std::size_t size_ = 0;
};

/// Memory on the device for many things of all sizes: drivers allow a few thousand allocations
/// only. From any thread.
class VulkanArena {
 public:
  explicit VulkanArena(const VulkanDevice& device) : device_(device) {}
  VulkanArena(const VulkanArena&) = delete;
  VulkanArena& operator=(const VulkanArena&) = delete;

  /// Begins at a multiple of 256 bytes in its buffer.
  VulkanRange take(std::size_t size, const char* what);
  /// Buffers that it holds.
  std::size_t buffer_count() const;

 private:
  friend class VulkanRange;
  struct Block {
    VulkanBuffer buffer;
    std::map<std::size_t, std::size_t> gaps;  ///< Sizes by offset; no two touch.
  };
  void give_back(const VulkanBuffer* buffer, std::size_t offset, std::size_t size);

  const VulkanDevice& device_;
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<Block>> blocks_;
};

}  // namespace diorama
