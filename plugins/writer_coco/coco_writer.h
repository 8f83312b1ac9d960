// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/training_data.h"

namespace diorama {

/// COCO (cocodataset.org/#format-data):
///
///     dataset.json categories.json
///     images/{train,val}/000012_cam_0.png
///     annotations/instances_{train,val}.json
///     annotations/panoptic_{train,val}.json  panoptic/{train,val}/000012_cam_0.png
///
/// Image ids count from 1 over captures and cameras, annotation ids from 1 within a file. Masks are
/// compressed run lengths of the visible pixels. Annotations with fewer visible pixels than
/// `crowd_below_px` are marked iscrowd, so that an evaluation ignores them instead of punishing a
/// detector for either answer.
class CocoWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool keypoints = true;
    bool amodal = true;
    bool panoptic = true;
    int crowd_below_px = 0;

    void visit(ParamVisitor& v);
  };

  CocoWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  Json categories() const;
  Json annotation(const Frame& frame, const TrainingObject& object, int image_id) const;
  Json panoptic_annotation(const Frame& frame, const std::vector<TrainingObject>& objects,
                           int image_id, const std::string& stem, const char* split,
                           CaptureFiles& files) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
