// SPDX-License-Identifier: Apache-2.0
#include "spare_pages.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace diorama {
namespace {

/// What waits at most: of two pictures of 640 x 480 that are under way at a time.
constexpr std::size_t kMostKept = std::size_t(160) << 20;

struct Holder {
  std::mutex mutex;
  std::weak_ptr<SparePages> pages;
};
Holder& holder() {
  static Holder holder;
  return holder;
}

std::shared_ptr<SparePages> held() {
  const std::lock_guard lock(holder().mutex);
  return holder().pages.lock();
}

}  // namespace

std::shared_ptr<SparePages> SparePages::shared() {
  const std::lock_guard lock(holder().mutex);
  std::shared_ptr<SparePages> pages = holder().pages.lock();
  if (!pages) holder().pages = pages = std::make_shared<SparePages>();
  return pages;
}

SparePages::~SparePages() {
  for (const Block& block : blocks_) std::free(block.at);
}

void* SparePages::take(std::size_t& size) {
  size = (size + kHugePage - 1) / kHugePage * kHugePage;
  if (const auto pages = held(); pages && keeps(size)) {
    if (void* const block = pages->find(size)) return block;
  }
  void* const block = std::aligned_alloc(kHugePage, size);
  if (!block) throw std::bad_alloc();
  madvise(block, size, MADV_HUGEPAGE);
  return block;
}

void SparePages::give(void* block, std::size_t size) {
  if (const auto pages = held(); pages && pages->keep(block, size)) return;
  std::free(block);
}

void* SparePages::find(std::size_t& size) {
  const std::lock_guard lock(mutex_);
  auto best = blocks_.end();
  for (auto it = blocks_.begin(); it != blocks_.end(); ++it) {
    if (it->size >= size && (best == blocks_.end() || it->size < best->size)) best = it;
  }
  if (best == blocks_.end()) return nullptr;
  const Block found = *best;
  blocks_.erase(best);
  size_ -= found.size;
  size = found.size;
  return found.at;
}

bool SparePages::keep(void* block, std::size_t size) {
  const std::lock_guard lock(mutex_);
  if (!keeps(size) || size_ + size > kMostKept) return false;
  blocks_.push_back({block, size});
  size_ += size;
  return true;
}

}  // namespace diorama
