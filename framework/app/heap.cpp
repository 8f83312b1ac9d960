// SPDX-License-Identifier: Apache-2.0
#include "framework/app/heap.h"

#include <malloc.h>

namespace diorama {

void give_large_blocks_back() {
#ifdef __GLIBC__
  constexpr int kLargeBlock = 512 << 10;
  mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  mallopt(M_TRIM_THRESHOLD, 2 * kLargeBlock);
#endif
}

void give_free_pages_back() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

void keep_large_blocks() {
#ifdef __GLIBC__
  constexpr int kLargeBlock = 32 << 20;  // the largest that glibc takes
  mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  mallopt(M_TRIM_THRESHOLD, 4 * kLargeBlock);
#endif
}

}  // namespace diorama
