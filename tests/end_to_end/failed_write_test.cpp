// SPDX-License-Identifier: Apache-2.0
// Disks that fill up, quotas and permissions, in the middle of a run.
#include <sys/mount.h>

#include <cerrno>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

/// An environment variable of the processes that are started while it lives.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { ::unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
};

/// A small file system in memory.
class SmallDisk {
 public:
  SmallDisk(const fs::path& folder, const std::string& size) : folder_(folder) {
    fs::create_directories(folder);
    is_mounted_ = ::mount("tmpfs", folder.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (is_mounted_) ::umount(folder_.c_str());
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool is_mounted() const { return is_mounted_; }
  void grow(const std::string& size) const {
    REQUIRE(::mount("tmpfs", folder_.c_str(), "tmpfs", MS_REMOUNT, ("size=" + size).c_str()) == 0);
  }

 private:
  fs::path folder_;
  bool is_mounted_ = false;
};

const std::vector<std::string> kLonger{"--set", "total_captures=20"};

std::vector<std::string> failing_job(const fs::path& output, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments{"run", config_file("smoke.yaml"), "--output", output.string()};
  arguments.insert(arguments.end(), kLonger.begin(), kLonger.end());
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

const std::map<std::string, std::string>& undisturbed_dataset() {
  static const std::map<std::string, std::string> files = [] {
    const TemporaryFolder folder;
    REQUIRE(run(failing_job(folder / "out"), folder.path()).exit_code == 0);
    return tree(folder / "out");
  }();
  return files;
}

std::size_t bytes_of(const std::map<std::string, std::string>& files) {
  std::size_t bytes = 0;
  for (const auto& [name, text] : files) bytes += text.size();
  return bytes;
}

void expect_one_message(const Outcome& outcome, const std::string& reason) {
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 6);
  CHECK_THAT(outcome.errors, ContainsSubstring(reason));
  const std::size_t first = outcome.errors.find("error: ");
  REQUIRE(first != std::string::npos);
  CHECK(outcome.errors.find("error: ", first + 1) == std::string::npos);
}

/// Every file is that of the whole dataset, and belongs to a capture all of whose files are there.
void expect_whole_captures(const fs::path& output) {
  const auto left = tree(output);
  std::size_t captures = 0;
  std::set<std::string> owned{"dataset.json"};
  for (const auto& [name, text] : tree(output / ".diorama/journal")) {
    if (!name.ends_with(".index")) continue;
    const std::string entries =
        read_file(output / ".diorama/journal" / (name.substr(0, name.size() - 6) + ".entries"));
    std::istringstream lines(text);
    for (std::string kind, entry; lines >> kind >> entry;) {
      std::size_t offset = 0, length = 0;
      if (kind == "c" && lines >> offset >> length) {
        if (entry != "begin") ++captures;
        const auto json = nlohmann::json::parse(entries.substr(offset, length));
        for (const auto& file : json.at("files")) owned.insert(file.at(0).get<std::string>());
      }
      lines.ignore(1000, '\n');
    }
  }
  CHECK(captures > 0);
  CHECK(captures < 20);
  for (const std::string& name : owned) {
    INFO(name);
    REQUIRE(left.contains(name));
    CHECK(left.at(name) == undisturbed_dataset().at(name));
  }
  for (const auto& [name, text] : left) {
    INFO(name);
    CHECK(owned.contains(name));
  }
}

}  // namespace

TEST_CASE("A write that fails ends the run with one message and whole captures", "[failed_write]") {
  const auto [number, reason] =
      GENERATE(table<int, std::string>({{ENOSPC, "No space left on device"},
                                        {EDQUOT, "Disk quota exceeded"},
                                        {EIO, "Input/output"}}));
  const TemporaryFolder folder;
  {
    const Variable preload("LD_PRELOAD", DIORAMA_FAILING_WRITE);
    const Variable below("DIORAMA_TEST_FAIL_BELOW", (folder / "out").string());
    const Variable after("DIORAMA_TEST_FAIL_AFTER",
                         std::to_string(bytes_of(undisturbed_dataset()) / 2));
    const Variable with("DIORAMA_TEST_FAIL_WITH", std::to_string(number));
    // Sanitizers want to be loaded first.
    const Variable order("ASAN_OPTIONS", "verify_asan_link_order=0");
    expect_one_message(run(failing_job(folder / "out"), folder.path()), reason);
  }
  expect_whole_captures(folder / "out");
  CHECK(run(failing_job(folder / "out", {"--resume"}), folder.path()).exit_code == 0);
  CHECK(difference(undisturbed_dataset(), tree(folder / "out")) == "");
}

TEST_CASE("A disk that is too small ends the run; with more room it goes on", "[failed_write]") {
  const TemporaryFolder folder;
  const SmallDisk disk(folder / "disk", "2m");
  if (!disk.is_mounted()) {
    WARN("mounting is not allowed here: no small disk tried");
    return;
  }
  expect_one_message(run(failing_job(folder / "disk/out"), folder.path()),
                     "No space left on device");
  expect_whole_captures(folder / "disk/out");
  disk.grow("64m");
  CHECK(run(failing_job(folder / "disk/out", {"--resume"}), folder.path()).exit_code == 0);
  CHECK(difference(undisturbed_dataset(), tree(folder / "disk/out")) == "");
}

TEST_CASE("A folder that may not be written to is named at start", "[failed_write]") {
  if (::geteuid() == 0) {
    WARN("root may write everywhere: no permission tried");
    return;
  }
  const TemporaryFolder folder;
  fs::create_directories(folder / "locked");
  fs::permissions(folder / "locked", fs::perms::owner_read | fs::perms::owner_exec);
  expect_one_message(run(failing_job(folder / "locked/out"), folder.path()), "Permission denied");
  fs::permissions(folder / "locked", fs::perms::owner_all);
}
