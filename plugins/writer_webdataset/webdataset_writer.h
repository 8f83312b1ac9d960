// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/channel_list.h"
#include "writer_support/training_data.h"

namespace diorama {

/// Tar shards for the WebDataset library, one per capture, so that a shard is on disk completely or
/// not at all:
///
///     dataset.json train.txt val.txt          (the shards of each part, one per line)
///     shards/000012.tar
///
/// A sample is one camera's picture; the files of its key are
///     000012_cam_0.png              the picture
///     000012_cam_0.json             camera and objects: class, box, pose, bounds, visible share
///     000012_cam_0.instances.png    16 bit: object's place in the list + 1; 0: none
///     000012_cam_0.depth.npy        float32, metres along the viewing axis, infinity: nothing
///     000012_cam_0.disparity.npy    each of `channels`
class WebDatasetWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool depth = true;
    bool instances = true;
    ChannelList channels;

    void visit(ParamVisitor& v);
  };

  WebDatasetWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  Json sample_json(const Capture& capture, const Frame& frame,
                   const std::vector<TrainingObject>& objects) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
