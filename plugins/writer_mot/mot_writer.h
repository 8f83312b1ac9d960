// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/training_data.h"

namespace diorama {

/// MOT Challenge (Milan et al., "MOT16", 2016):
///
///     dataset.json
///     {train,val}/clip_0003_cam_0/img1/000001.png
///                                 gt/gt.txt
///                                 seqinfo.ini
///
/// Each camera of a clip is a sequence. A line of gt.txt is frame, track, left, top, width, height,
/// 1, class, visibility; frames, classes and pixels count from 1. A track is the number of the
/// object's node, visibility the share of the whole object that is seen: neither hidden nor out of
/// the picture. Captures that are in no clip are sequences of one frame.
class MotWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    void visit(ParamVisitor& v);
  };

  MotWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
