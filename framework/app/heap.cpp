// SPDX-License-Identifier: Apache-2.0
#include "framework/app/heap.h"

#include <malloc.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <new>

#include "diorama/abi.h"

namespace diorama {
namespace {

constexpr std::size_t kLargeBlock = std::size_t(512) << 10;
/// Of still larger ones it is not sure that all of it is filled.
constexpr std::size_t kLargestMapped = std::size_t(16) << 20;

std::atomic<bool> maps_large_blocks = false;

/// Systems that do not know how (before Linux 5.14) map page by page, as always.
void map_whole(void* block, std::size_t size) {
#ifdef MADV_POPULATE_WRITE
  constexpr std::uintptr_t kPage = 4096;
  const auto begin = reinterpret_cast<std::uintptr_t>(block) & ~(kPage - 1);
  const auto end = (reinterpret_cast<std::uintptr_t>(block) + size) & ~(kPage - 1);
  madvise(reinterpret_cast<void*>(begin), end - begin, MADV_POPULATE_WRITE);
#endif
}

}  // namespace

void give_large_blocks_back() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, int(kLargeBlock));
  mallopt(M_TRIM_THRESHOLD, int(2 * kLargeBlock));
  maps_large_blocks = true;
#endif
}

void share_heaps([[maybe_unused]] int threads) {
#ifdef __GLIBC__
  const char* tunables = std::getenv("GLIBC_TUNABLES");
  const bool is_chosen = std::getenv("MALLOC_ARENA_MAX") != nullptr ||
                         (tunables && std::strstr(tunables, "glibc.malloc.arena_max="));
  if (!is_chosen) mallopt(M_ARENA_MAX, std::max(2, threads / 2));
#endif
}

std::chrono::nanoseconds give_free_pages_back() {
  // Not the time of the wall: on a busy machine it is that of others.
  const auto used = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  };
  const auto begin = used();
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  return used() - begin;
}

void keep_large_blocks() {
#ifdef __GLIBC__
  constexpr int kLargest = 32 << 20;  // that glibc takes
  mallopt(M_MMAP_THRESHOLD, kLargest);
  mallopt(M_TRIM_THRESHOLD, 4 * kLargest);
#endif
}

}  // namespace diorama

#if defined(__GLIBC__) && !DIORAMA_DETAIL_ADDRESS_SANITIZER && !DIORAMA_DETAIL_THREAD_SANITIZER
/// The C++ library's, and large blocks mapped; `delete` is that of the library.
void* operator new(std::size_t size) {
  while (true) {
    if (void* const block = std::malloc(std::max<std::size_t>(size, 1))) {
      if (size >= diorama::kLargeBlock && size <= diorama::kLargestMapped &&
          diorama::maps_large_blocks) {
        diorama::map_whole(block, size);
      }
      return block;
    }
    const std::new_handler handler = std::get_new_handler();
    if (!handler) throw std::bad_alloc();
    handler();
  }
}
#endif
