// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "framework/lint/lint_dataset.h"
#include "plugins/writer_support/memory_files.h"
#include "support/catch.h"

namespace diorama::test {

/// A dataset on disk that is removed with the object.
class DatasetOnDisk {
 public:
  explicit DatasetOnDisk(const MemoryFiles& files)
      : folder_(std::filesystem::temp_directory_path() /
                ("diorama_lint_" + std::to_string(getpid()) + "_" +
                 std::to_string(reinterpret_cast<std::uintptr_t>(this)))) {
    for (const auto& [path, bytes] : files.files) {
      std::filesystem::create_directories((folder_ / path).parent_path());
      write(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
  }
  ~DatasetOnDisk() { std::filesystem::remove_all(folder_); }

  std::string read(const std::string& path) const {
    std::ifstream in(folder_ / path, std::ios::binary);
    REQUIRE(in);
    std::ostringstream text;
    text << in.rdbuf();
    return std::move(text).str();
  }
  void write(const std::string& path, const std::string& text) const {
    std::ofstream(folder_ / path, std::ios::binary) << text;
  }
  void remove(const std::string& path) const { REQUIRE(std::filesystem::remove(folder_ / path)); }
  void truncate(const std::string& path) const {
    std::filesystem::resize_file(folder_ / path, std::filesystem::file_size(folder_ / path) / 2);
  }
  void replace(const std::string& path, const std::string& from, const std::string& to) const {
    std::string text = read(path);
    const std::size_t at = text.find(from);
    REQUIRE(at != std::string::npos);
    write(path, text.replace(at, from.size(), to));
  }
  /// Changes one number of a binary file.
  template <class T>
  void poke(const std::string& path, std::size_t offset, T value) const {
    std::string text = read(path);
    REQUIRE(offset + sizeof value <= text.size());
    std::memcpy(text.data() + offset, &value, sizeof value);
    write(path, text);
  }
  template <class T>
  T peek(const std::string& path, std::size_t offset) const {
    const std::string text = read(path);
    T value{};
    std::memcpy(&value, text.data() + offset, sizeof value);
    return value;
  }

  LintReport lint() const {
    EncodingHost host;
    DatasetReaders readers = every_reader(host);
    const auto reports = lint_datasets(folder_, readers, host);
    REQUIRE(reports.size() == 1);
    return reports[0];
  }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

}  // namespace diorama::test
