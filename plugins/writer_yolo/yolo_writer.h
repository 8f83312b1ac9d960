// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/named_keypoints.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The folder layout and label lines of Ultralytics YOLO (docs.ultralytics.com/datasets):
///
///     data.yaml dataset.json
///     images/{train,val}/000012_cam_0.png
///     labels/{train,val}/000012_cam_0.txt
///
/// One line per object, the class index first, all coordinates as shares of the image's size:
/// detect: box centre and size, of what is seen and a margin round it; segment: a polygon of the
/// visible pixels; pose: box, then x y v of the keypoints that the job names, of all classes, or
/// else of nine cuboid points; obb: the four corners of the least rectangle. A picture without
/// objects has an empty label file.
class YoloWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    std::string task = "detect";
    double box_margin = 0.0;

    void visit(ParamVisitor& v);
  };

  YoloWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  std::string line(const Frame& frame, const TrainingObject& object) const;

  Params params_;
  Host& host_;
  TrainingData training_;
  NamedKeypoints keypoints_;
};

}  // namespace diorama
