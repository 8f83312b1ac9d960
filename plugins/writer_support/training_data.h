// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/class_choice.h"
#include "writer_support/python_json.h"

/// What the writers of training formats have in common: class list, split into training and
/// validation data, names of pictures, and the page of conventions.
namespace diorama {

inline constexpr const char* kTrainingImageFormats[] = {"png", "jpg"};

struct TrainingParams {
  double val_share = 0.2;
  std::vector<std::string> classes;
  std::string taxonomy = "class";
  int min_visible_px = 1;
  std::string image_format = "png";
  bool masks = true;  ///< False: objects are those that have boxes, and their pixels unknown.

  void visit(ParamVisitor& v);
  /// For writers that can do without the pixels of objects: adds `masks`.
  void visit_masks(ParamVisitor& v);
};

/// A visible instance with a class of the list.
struct TrainingObject {
  const Instance* instance = nullptr;
  int class_index = 0;          ///< From 0.
  std::int64_t visible_px = 0;  ///< Without masks: those of its box.
};

class TrainingData {
 public:
  explicit TrainingData(TrainingParams params)
      : params_(std::move(params)), choice_(params_.taxonomy) {}
  /// For writers that choose labels in another way. Objects of classes that are not in the list are
  /// of the class `other` where that is one, instead of being left out.
  TrainingData(TrainingParams params, ClassChoice choice, std::string other = {})
      : params_(std::move(params)), choice_(std::move(choice)), other_(std::move(other)) {}

  /// Fixes the class list and the split. Where the dataset does not say them both follow from the
  /// job alone, so they are equal in every shard.
  void begin(const DatasetInfo& dataset);

  const std::vector<std::string>& classes() const { return classes_; }
  /// The classes that these label sets say, as places in the list, each once in the list's order.
  std::vector<int> classes_of(const std::vector<Labels>& labels) const;
  /// "train" or "val".
  const char* split(int capture) const {
    return is_val_.at(std::size_t(capture)) ? "val" : "train";
  }
  /// Both, in this order; "val" only when it has captures.
  std::vector<std::string> splits() const;
  int capture_count() const { return int(is_val_.size()); }
  int camera_count() const { return camera_count_; }

  /// "000012_cam_0": sorts like the captures.
  std::string image_stem(const Capture& capture, const Frame& frame) const;
  /// "png" or "jpg".
  const std::string& image_format() const { return params_.image_format; }
  /// The frame's picture without alpha.
  std::vector<std::byte> image_file(const Host& host, const Frame& frame) const;

  /// In the order of Frame::instances. Objects of classes that are not in the list are left out: an
  /// environment's own labels count only when `classes` names them. Needs kInstanceId for masks.
  std::vector<TrainingObject> objects(const Frame& frame) const;

  /// Adds dataset.json: what the numbers of this dataset mean and where it comes from. `more` holds
  /// the format's own conventions.
  void add_dataset_page(const std::string& format, Json more, const DatasetInfo& dataset,
                        DatasetFiles& files) const;

 private:
  /// The place of an object's class in the list, or -1.
  int class_of(const Labels& labels) const;
  /// Adds a page whose split is still empty, with the split.
  void add_page(const std::string& page, DatasetFiles& files) const;

  TrainingParams params_;
  ClassChoice choice_;
  std::string other_;
  std::vector<std::string> classes_;
  std::vector<bool> is_val_;
  int padding_ = 6;
  int camera_count_ = 0;
};

}  // namespace diorama
