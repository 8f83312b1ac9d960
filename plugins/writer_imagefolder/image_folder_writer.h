// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The image folder of Hugging Face Datasets (huggingface.co/docs/datasets/image_dataset):
///
///     dataset.json README.md
///     {train,validation}/metadata.jsonl  {train,validation}/000012_cam_0.png
///
/// A line of metadata.jsonl is one picture: file_name, image_id, width, height, and `objects` as
/// lists of equal length: bbox (x, y, width, height in pixels), categories (from 0), area (visible
/// pixels), id, visible_share. README.md is the dataset's card: splits and names of categories.
class ImageFolderWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;

    void visit(ParamVisitor& v) {
      training.visit(v);
      training.visit_masks(v);
    }
  };

  ImageFolderWriter(Params params, Host& host)
      : params_(std::move(params)), host_(host), training_(params_.training) {}

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  std::string metadata_line(const Capture& capture, std::size_t camera,
                            const std::string& file) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
