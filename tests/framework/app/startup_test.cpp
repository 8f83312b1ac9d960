// SPDX-License-Identifier: Apache-2.0
// What listing and describing plugins loads into the process.
#include <algorithm>
#include <fstream>
#include <iostream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "framework/app/cli.h"
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
