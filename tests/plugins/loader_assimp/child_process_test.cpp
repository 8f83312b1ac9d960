// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/child_process.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "diorama/abi.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_assimp {

TEST_CASE("a child process says what it returned, threw or died of", "[loader_assimp]") {
  constexpr ChildLimits kPlenty{60, std::uint64_t(1) << 32};
  CHECK(run_in_child(kPlenty, [] { return std::string(); }).empty());
  // More than a pipe holds at once.
  const std::string long_text(200'000, 'x');
  CHECK(run_in_child(kPlenty, [&] { return long_text; }) == long_text);
  CHECK(run_in_child(kPlenty, []() -> std::string { throw std::runtime_error("why"); }) == "why");
  CHECK(run_in_child(kPlenty, [] {
          raise(SIGSEGV);
          return std::string();
        }).starts_with("crashes"));
}

TEST_CASE("a child process that does not end is ended", "[loader_assimp]") {
  const std::string why = run_in_child({1, std::uint64_t(1) << 32}, [] {
    const std::atomic<bool> is_done{false};
    while (!is_done) {
    }
    return std::string();
  });
  CHECK(why == "takes more than 1 s of processor time");
  const std::string waits = run_in_child({60, std::uint64_t(1) << 32, 1}, [] {
    for (;;) pause();
    return std::string();
  });
  CHECK(waits == "takes more than 1 s");
}

TEST_CASE("a child process that waits in vain is replaced", "[loader_assimp]") {
  constexpr ChildLimits kPlenty{60, std::uint64_t(1) << 32};
  const test::TemporaryFolder folder;
  const std::filesystem::path marker = folder.path("the first one was here");
  const std::string second = run_in_child(kPlenty, [&]() -> std::string {
    if (std::filesystem::exists(marker)) return "the second one's answer";
    std::ofstream(marker) << '.';
    for (;;) pause();
  });
  CHECK(second == "the second one's answer");
}

#if !DIORAMA_DETAIL_ADDRESS_SANITIZER
TEST_CASE("a child process gets no more memory than it may", "[loader_assimp]") {
  const std::string why = run_in_child({60, 64u << 20}, [] {
    const std::vector<char> much(std::size_t(1) << 30, 'x');
    return std::string(much.data(), 1);
  });
  CHECK(why == "std::bad_alloc");
}
#endif

}  // namespace diorama::loader_assimp
