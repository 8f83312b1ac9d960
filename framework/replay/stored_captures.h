// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "diorama/config.h"
#include "diorama/frame.h"
#include "framework/datasets/dataset_readers.h"

namespace diorama {

/// What a run's writers left of its captures, as frames again for sensors: linear colour, depth,
/// lens and seed are those of the run, number by number. Any dataset of the run will do that holds
/// them.
class StoredCaptures {
 public:
  /// `folder` is the output of a run, `channels` of those in stored_channels(). Throws Error(Usage)
  /// when it holds no dataset, or none of them holds all of the channels and the cameras. The
  /// readers must outlive the object.
  StoredCaptures(const std::filesystem::path& folder, const NameSet& channels,
                 DatasetReaders& readers);

  /// Channels that sensors may need and datasets may hold.
  static NameSet stored_channels();

  /// Of the captures that are there, ascending.
  const std::vector<int>& indices() const { return dataset_->info().captures; }
  /// The capture at place `i` of indices(). Throws Error(Asset) naming the file that cannot be
  /// read.
  Capture read(std::size_t i) const;

  /// dataset.json of the run.
  const std::string& dataset_json() const { return dataset_json_; }
  /// Entry of the writer in the resolved job.
  const Value& writer() const { return writer_; }
  const std::string& writer_name() const { return writer_name_; }
  std::uint64_t seed() const { return seed_; }
  int capture_count() const { return capture_count_; }
  const std::vector<std::string>& camera_names() const { return camera_names_; }

 private:
  void choose_dataset(const std::filesystem::path& folder, const std::string& job,
                      DatasetReaders& readers);

  NameSet channels_;
  std::string dataset_json_;
  std::uint64_t seed_ = 0;
  int capture_count_ = 0;
  std::vector<std::string> camera_names_;
  Value writer_;
  std::string writer_name_;
  std::filesystem::path writer_folder_;
  std::unique_ptr<const StoredDataset> dataset_;
};

}  // namespace diorama
