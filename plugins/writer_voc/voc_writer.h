// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/training_data.h"

namespace diorama {

/// Pascal VOC 2012 (host.robots.ox.ac.uk/pascal/VOC):
///
///     dataset.json labels.txt
///     ImageSets/Main/{train,val,trainval}.txt  ImageSets/Main/mug_{train,val,trainval}.txt
///     ImageSets/Segmentation/{train,val,trainval}.txt
///     JPEGImages/000012_cam_0.jpg  Annotations/000012_cam_0.xml
///     SegmentationClass/000012_cam_0.png  SegmentationObject/000012_cam_0.png
///
/// Boxes count pixels from 1 and include the last one. The list of a class says of each picture 1
/// where it shows one, 0 where it shows difficult ones only, else -1. Segmentation pictures are
/// 8-bit indices into the benchmark's palette: class index + 1, or the object's place in the
/// annotation file + 1; 0 is background.
class VocWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool segmentation = true;
    double difficult_below = 0.2;

    Params() { training.image_format = "jpg"; }
    void visit(ParamVisitor& v);
  };

  VocWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  void add_image_sets(const std::string& folder, const DatasetInfo& dataset,
                      DatasetFiles& files) const;
  bool is_difficult(const Instance& instance) const;
  /// One letter per class: what its list says of a picture of these objects.
  std::string occurrences(const std::vector<TrainingObject>& objects) const;
  std::string object_xml(const Frame& frame, const TrainingObject& object) const;
  void write_segmentation(const Frame& frame, const std::vector<TrainingObject>& objects,
                          const std::string& stem, CaptureFiles& files) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
