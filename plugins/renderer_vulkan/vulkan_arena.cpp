// SPDX-License-Identifier: Apache-2.0
#include "vulkan_arena.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace diorama {
namespace {

constexpr std::size_t kBlockSize = std::size_t(32) << 20;
constexpr std::size_t kStep = 256;  // as acceleration structures want it

}  // namespace

VulkanRange::~VulkanRange() {
  if (arena_) arena_->give_back(buffer_, offset_, size_);
}

VulkanRange& VulkanRange::operator=(VulkanRange&& other) noexcept {
  std::swap(arena_, other.arena_);
  std::swap(buffer_, other.buffer_);
  std::swap(offset_, other.offset_);
  std::swap(size_, other.size_);
  return *this;
}

std::size_t VulkanArena::buffer_count() const {
  const std::lock_guard lock(mutex_);
  return blocks_.size();
}

VulkanRange VulkanArena::take(std::size_t size, const char* what) {
  const std::lock_guard lock(mutex_);
  VulkanRange range;
  range.size_ = (std::max<std::size_t>(size, 1) + kStep - 1) / kStep * kStep;
  const auto take_from = [&](Block& block) {
    const auto gap = std::ranges::find_if(
        block.gaps, [&](const auto& entry) { return entry.second >= range.size_; });
    if (gap == block.gaps.end()) return false;
    const auto [offset, room] = *gap;
    block.gaps.erase(gap);
    if (room > range.size_) block.gaps.emplace(offset + range.size_, room - range.size_);
    range.arena_ = this;
    range.buffer_ = &block.buffer;
    range.offset_ = offset;
    return true;
  };
  for (const auto& block : blocks_) {
    if (take_from(*block)) return range;
  }
  // What fills most of a block has one of its own.
  const std::size_t room = range.size_ > kBlockSize / 2 ? range.size_ : kBlockSize;
  auto block = std::make_unique<Block>();
  block->buffer = VulkanBuffer(device_, room, VulkanBuffer::Place::Device, what);
  block->gaps.emplace(0, room);
  blocks_.push_back(std::move(block));
  take_from(*blocks_.back());
  return range;
}

void VulkanArena::give_back(const VulkanBuffer* buffer, std::size_t offset, std::size_t size) {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::ranges::find_if(blocks_, [&](const auto& block) { return &block->buffer == buffer; });
  auto& gaps = (*found)->gaps;
  auto gap = gaps.emplace(offset, size).first;
  if (const auto next = std::next(gap); next != gaps.end() && offset + size == next->first) {
    gap->second += next->second;
    gaps.erase(next);
  }
  if (gap != gaps.begin()) {
    const auto before = std::prev(gap);
    if (before->first + before->second == gap->first) {
      before->second += gap->second;
      gaps.erase(gap);
      gap = before;
    }
  }
  if (gap->second == buffer->size()) blocks_.erase(found);
}

}  // namespace diorama
