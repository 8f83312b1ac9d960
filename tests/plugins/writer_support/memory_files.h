// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diorama/writer.h"

namespace diorama::test {

/// Keeps files and records in memory. Adding a path twice throws, and so does appending to one that
/// was added.
class MemoryFiles final : public CaptureFiles {
 public:
  void add(std::string_view path, std::vector<std::byte> bytes) override;
  void append(std::string_view path, std::span<const std::byte> bytes) override;
  void append_kept(std::string_view path, int from) override;
  void record(std::string_view line) override;
  void keep(std::span<const std::byte> bytes) override;

  std::set<std::string> paths() const;
  /// Throws when it is not there.
  const std::vector<std::byte>& bytes(const std::string& path) const;
  std::string text(const std::string& path) const;

  std::map<std::string, std::vector<std::byte>> files;
  std::vector<std::pair<int, std::string>> records;  ///< With `capture`, see below.
  std::map<int, std::vector<std::byte>> kept;        ///< Of captures.
  int capture = 0;  ///< What the next record, and what is kept, belongs to.

 private:
  std::set<std::string> growing_;
};

/// Runs begin(), write() for each capture and finish().
MemoryFiles write_dataset(Writer& writer, const DatasetInfo& dataset,
                          const std::vector<const Capture*>& captures);

}  // namespace diorama::test
