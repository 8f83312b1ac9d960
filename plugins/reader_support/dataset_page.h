// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diorama/reader.h"
#include "diorama/writer.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// What the page dataset.json says that our writers put into a training dataset's folder.
struct DatasetPage {
  int captures = 0;
  std::vector<std::string> cameras;
  std::vector<std::string> classes;
  std::map<int, std::string> split_of_capture;
  Json conventions = Json::object();  ///< An object always.
  std::vector<DatasetClip> clips;
  bool is_rendered = false;  ///< A job made it; else it comes from somebody else's dataset.

  /// One picture per capture and camera.
  std::size_t picture_count() const { return std::size_t(captures) * cameras.size(); }
  /// "000012_cam_0", as such writers name pictures.
  std::string stem(int capture, const std::string& camera) const;
};

/// Nothing when there is no such page, or one that cannot be read: such a dataset is read by the
/// format's rules alone.
std::optional<DatasetPage> read_dataset_page(const std::filesystem::path& folder);

/// Classes of which the page says that they are sorted are.
void check_class_order(const DatasetPage& page, StoredFiles& files);

/// Clips that the page lists; none without a page.
std::span<const DatasetClip> clips_of(const std::optional<DatasetPage>& page);
/// What a dataset with such clips holds.
void note_clips(std::span<const DatasetClip> clips, StoredInfo& info);

/// ByName when the page says this format.
Recognition recognise_page(const std::filesystem::path& folder, const std::string& format);

/// What Replicator's page metadata.txt says; an empty object when that is nothing.
Json metadata_page(const std::filesystem::path& folder);

/// The writer that Replicator's page metadata.txt names; empty when there is no such page.
std::string metadata_writer(const std::filesystem::path& folder);

/// `number` with leading zeros.
std::string zero_padded(int number, std::size_t digits);

}  // namespace diorama
