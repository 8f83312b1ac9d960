// SPDX-License-Identifier: Apache-2.0
#include "plugins/writer_support/memory_files.h"

#include <algorithm>
#include <stdexcept>

namespace diorama::test {

void MemoryFiles::add(std::string_view path, std::vector<std::byte> bytes) {
  if (!files.emplace(path, std::move(bytes)).second) {
    throw std::logic_error(std::string(path) + ": written twice");
  }
}

void MemoryFiles::append(std::string_view path, std::span<const std::byte> bytes) {
  if (growing_.emplace(path).second) add(path, {});
  std::vector<std::byte>& file = files[std::string(path)];
  file.insert(file.end(), bytes.begin(), bytes.end());
}

void MemoryFiles::append_kept(std::string_view path, int from) { append(path, kept.at(from)); }

void MemoryFiles::keep(std::span<const std::byte> bytes) {
  kept[capture].insert(kept[capture].end(), bytes.begin(), bytes.end());
}

void MemoryFiles::record(std::string_view line) { records.emplace_back(capture, line); }

std::set<std::string> MemoryFiles::paths() const {
  std::set<std::string> result;
  for (const auto& [path, bytes] : files) result.insert(path);
  return result;
}

const std::vector<std::byte>& MemoryFiles::bytes(const std::string& path) const {
  const auto found = files.find(path);
  if (found == files.end()) throw std::logic_error(path + ": not written");
  return found->second;
}

std::string MemoryFiles::text(const std::string& path) const {
  const auto& found = bytes(path);
  return {reinterpret_cast<const char*>(found.data()), found.size()};
}

MemoryFiles write_dataset(Writer& writer, const DatasetInfo& dataset,
                          const std::vector<const Capture*>& captures) {
  MemoryFiles files;
  writer.begin(dataset, files);
  for (const Capture* capture : captures) {
    files.capture = capture->index;
    writer.write(*capture, files);
  }
  auto records = files.records;
  std::ranges::stable_sort(records, {}, &std::pair<int, std::string>::first);
  writer.finish(
      [&records](const RecordVisitor& visit) {
        for (const auto& [capture, line] : records) visit(capture, line);
      },
      files);
  return files;
}

}  // namespace diorama::test
