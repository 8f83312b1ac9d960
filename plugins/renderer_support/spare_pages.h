// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace diorama {

/// Blocks of huge pages between pictures: the system clears what it gives anew, which takes longer
/// than to fill it. Thread-safe.
class SparePages {
 public:
  /// Whether a block of that size may wait for the next picture; larger ones go back at once.
  static bool keeps(std::size_t size) { return size <= kLargestBlock; }

  /// The library's only ones, which live as long as somebody holds them.
  static std::shared_ptr<SparePages> shared();

  SparePages() = default;
  ~SparePages();
  SparePages(const SparePages&) = delete;
  SparePages& operator=(const SparePages&) = delete;

  /// Whole huge pages, as many as `size` needs or more where these are at hand; `size` becomes
  /// theirs. All comes from the system and goes back to it while nobody holds shared().
  static void* take(std::size_t& size);
  static void give(void* block, std::size_t size);

 private:
  static constexpr std::size_t kHugePage = std::size_t(1) << 21;
  static constexpr std::size_t kLargestBlock = std::size_t(32) << 20;

  struct Block {
    void* at;
    std::size_t size;
  };
  void* find(std::size_t& size);
  bool keep(void* block, std::size_t size);

  std::mutex mutex_;
  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

}  // namespace diorama
