// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

namespace diorama {

// How the C library's heap treats blocks as large as pictures; for the whole program, from now on.

/// They go back to the system when they are freed. By itself glibc keeps ever larger ones, up to
/// 32 MiB, in heaps that it can only cut at their ends: memory would creep up over thousands of
/// captures. What `new` then gets of them is mapped as a whole: a fault for each page takes longer
/// than to fill it.
void give_large_blocks_back();

/// Two of `threads` that start from now on share a heap; up to five share two. By itself glibc
/// gives each its own, and in all of them what is kept long, like assets, comes to lie among what
/// is soon freed. What the user says by MALLOC_ARENA_MAX or GLIBC_TUNABLES stays.
void share_heaps(int threads);

/// All pages that hold nothing, wherever in the heap. Small blocks of thousands of captures leave
/// holes that are never quite filled again. Returns how long the processor had to do with it.
std::chrono::nanoseconds give_free_pages_back();

/// They stay with the program: reading a picture every few milliseconds, it would spend a third of
/// its time on pages that the system clears for it. For programs that end soon.
void keep_large_blocks();

}  // namespace diorama
