// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "diorama/reader.h"
#include "framework/view/capture_index.h"

namespace diorama {

/// Indexes of datasets that were shown before, as files of the user. What cannot be read or written
/// there is as if it were not: an index can always be made anew.
class IndexCache {
 public:
  /// The oldest files leave when all of them are larger.
  static constexpr std::uintmax_t kMostBytes = std::uintmax_t(512) << 20;

  /// `folder` belongs to the cache alone; empty: nothing is kept.
  explicit IndexCache(std::filesystem::path folder, std::uintmax_t most_bytes = kMostBytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}

  /// A dataset as it is now.
  struct Key {
    std::string place;    ///< Of its folder's path.
    std::string content;  ///< Of names, sizes, times and inodes of all its files.
    bool operator==(const Key&) const = default;
  };
  /// Nothing when nothing is kept, or files are elsewhere behind links.
  std::optional<Key> key_of(const std::filesystem::path& dataset, const StoredInfo& info) const;

  /// Fills an empty index; false when there is none for this key.
  bool find(const Key& key, std::size_t captures, CaptureIndex& index) const;
  void keep(const Key& key, const CaptureIndex& index) const;

 private:
  std::filesystem::path file_of(const Key& key) const { return folder_ / (key.place + ".index"); }
  void remove_oldest(const std::filesystem::path& newest) const;

  std::filesystem::path folder_;
  std::uintmax_t most_bytes_;
};

/// `$XDG_CACHE_HOME/diorama/view`, or below ~/.cache; empty for who has no home.
std::filesystem::path index_cache_folder();

}  // namespace diorama
