// SPDX-License-Identifier: Apache-2.0
// What listing and describing plugins loads into the process, and how many heaps its threads have.
#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <latch>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "diorama/abi.h"
#include "framework/app/cli.h"
#include "framework/app/heap.h"
#include "support/catch.h"

namespace {

/// File names of all libraries in this process.
std::set<std::string> mapped_libraries() {
  std::set<std::string> names;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::string name = line.substr(line.rfind('/') + 1);
    if (name.find(".so") != name.npos) names.insert(name);
  }
  return names;
}

bool is_mapped(const std::string& begin) {
  return std::ranges::any_of(mapped_libraries(),
                             [&](const std::string& name) { return name.starts_with(begin); });
}

/// What the program prints.
std::string run(std::vector<const char*> words) {
  words.insert(words.begin(), {"diorama", "--plugin-dir", DIORAMA_PLUGIN_DIR});
  std::ostringstream out;
  std::streambuf* const usual = std::cout.rdbuf(out.rdbuf());
  const int code = diorama::run_program(int(words.size()), words.data());
  std::cout.rdbuf(usual);
  CHECK(code == 0);
  return out.str();
}

/// Heaps of the C library, as it counts them itself.
int heaps() {
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* const stream = open_memstream(&text, &size);
  malloc_info(0, stream);
  std::fclose(stream);
  const std::string report(text, size);
  std::free(text);
  int count = 0;
  for (std::size_t at = 0; (at = report.find("<heap nr=", at)) != report.npos; ++at) ++count;
  return count;
}

/// All there at a time, each with memory of its own.
void allocate_on_threads(int count) {
  std::latch all(count);
  std::vector<std::jthread> threads;
  for (int i = 0; i < count; ++i) {
    threads.emplace_back([&all] {
      const std::vector<char> block(10000, 'x');
      all.arrive_and_wait();
    });
  }
}

}  // namespace

TEST_CASE("nothing heavy is mapped before a job needs it", "[startup]") {
  CHECK(is_mapped("libdiorama_sdk.so"));
  const std::set<std::string> before = mapped_libraries();
  const std::string list = run({"plugins"});
  const std::set<std::string> after = mapped_libraries();
  CHECK(before == after);
  for (const char* heavy : {"libembree", "libopencv", "libassimp", "libBullet", "libhdf5"}) {
    INFO(heavy);
    CHECK_FALSE(is_mapped(heavy));
  }
  // The same look finds a library that is needed.
  if (list.find("  embree ") == list.npos) return;
  run({"plugins", "describe", "embree"});
  CHECK(is_mapped("renderer_embree.so"));
  CHECK(is_mapped("libembree"));
}

TEST_CASE("large blocks of a run are mapped as a whole", "[startup]") {
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
  WARN("sanitizers have heaps of their own: not measured");
#else
  constexpr std::size_t kSize = std::size_t(4) << 20;
  const auto faults = [] {
    rusage usage{};
    getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_minflt;
  };
  void* const page = mmap(nullptr, 1, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  const bool is_able = madvise(page, 4096, MADV_POPULATE_WRITE) == 0;
  munmap(page, 1);
  if (!is_able) {
    WARN("Linux before 5.14 maps page by page: not measured");
    return;
  }
  diorama::give_large_blocks_back();
  const auto block = std::make_unique_for_overwrite<char[]>(kSize);
  const long before = faults();
  std::fill_n(block.get(), kSize, 'x');
  CHECK(faults() - before < 16);  // of 1024
#endif
}

TEST_CASE("threads get no more heaps, unless the user says how many", "[startup]") {
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
  WARN("sanitizers have heaps of their own: not measured");
#else
  constexpr int kThreads = 5;
  unsetenv("GLIBC_TUNABLES");
  setenv("MALLOC_ARENA_MAX", "100", 1);
  diorama::share_heaps(4);
  unsetenv("MALLOC_ARENA_MAX");
  setenv("GLIBC_TUNABLES", "glibc.malloc.check=0:glibc.malloc.arena_max=100", 1);
  diorama::share_heaps(4);
  REQUIRE(heaps() < 3);
  allocate_on_threads(kThreads);
  const int before = heaps();
  CHECK(before >= kThreads);
  setenv("GLIBC_TUNABLES", "glibc.malloc.check=0", 1);
  diorama::share_heaps(4);
  allocate_on_threads(4 * kThreads);
  CHECK(heaps() == before);
#endif
}
