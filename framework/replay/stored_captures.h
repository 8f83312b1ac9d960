// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "diorama/config.h"
#include "diorama/frame.h"
#include "diorama/host.h"

namespace diorama {

/// What a run's BasicWriter left of its captures, as frames again: linear colour, depth, lens and
/// seed are those of the run, number by number. Poses and labels are not read.
class StoredCaptures {
 public:
  /// `folder` is the output of a run, `channels` of those in stored_channels(). Throws Error(Usage)
  /// when it holds no dataset, or none of its writers stored all of the channels and the cameras.
  StoredCaptures(const std::filesystem::path& folder, const NameSet& channels);

  /// Channels that can be read back.
  static NameSet stored_channels();

  /// Of the captures that are there, ascending.
  std::vector<int> indices() const;
  /// Throws Error(Asset) naming the file that cannot be read.
  Capture read(int index, const Host& host) const;

  /// dataset.json of the run.
  const std::string& dataset_json() const { return dataset_json_; }
  /// Entry of the writer in the resolved job.
  const Value& writer() const { return writer_; }
  const std::string& writer_name() const { return writer_name_; }
  std::uint64_t seed() const { return seed_; }
  int capture_count() const { return capture_count_; }
  const std::vector<std::string>& camera_names() const { return camera_names_; }

 private:
  /// Files of one camera in one capture by kind: "rgb.exr".
  using FrameFiles = std::map<std::string, std::filesystem::path>;
  void choose_writer(const std::filesystem::path& folder, const std::string& job);
  void list_files();
  Frame read_frame(const std::string& camera, int index, const FrameFiles& files,
                   const Host& host) const;

  NameSet channels_;
  std::string dataset_json_;
  std::uint64_t seed_ = 0;
  int capture_count_ = 0;
  std::vector<std::string> camera_names_;
  Value writer_;
  std::string writer_name_;
  std::filesystem::path writer_folder_;
  std::map<int, std::vector<FrameFiles>> captures_;  ///< Whole ones; frames in camera order.
};

}  // namespace diorama
