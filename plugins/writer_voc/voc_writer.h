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
///     ImageSets/Main/{train,val,trainval}.txt  ImageSets/Segmentation/...
///     JPEGImages/000012_cam_0.jpg  Annotations/000012_cam_0.xml
///     SegmentationClass/000012_cam_0.png  SegmentationObject/000012_cam_0.png
///
/// Boxes count pixels from 1 and include the last one. Segmentation pictures are 8-bit gray: class
/// index + 1, or the object's place in the annotation file + 1; 0 is background.
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

 private:
  std::string object_xml(const Frame& frame, const TrainingObject& object) const;
  void write_segmentation(const Frame& frame, const std::vector<TrainingObject>& objects,
                          const std::string& stem, CaptureFiles& files) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
