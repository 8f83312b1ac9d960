// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/channel_list.h"
#include "writer_support/training_data.h"
#include "writer_webdataset/tar_archive.h"

namespace diorama {

/// Tar shards for the WebDataset library. A capture's samples are in one shard; by default each
/// capture is a shard of its own, on disk as soon as it is made:
///
///     dataset.json train.txt val.txt          (the shards of each part, one per line)
///     shards/000012.tar
///
/// With `shard_captures` or `shard_size_mb` shards are filled in capture order at the dataset's
/// end, those of training and validation apart (ADR 0062):
///
///     shards/train-000000.tar shards/train-000001.tar shards/val-000000.tar
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
    int shard_captures = 0;      ///< 0: as many as the size allows, or one where that is open, too.
    double shard_size_mb = 0.0;  ///< 0: any.
    ChannelList channels;

    void visit(ParamVisitor& v);
  };

  WebDatasetWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  bool fills_shards() const { return params_.shard_captures > 1 || params_.shard_size_mb > 0.0; }
  /// All samples of a capture.
  void add_samples(const Capture& capture, TarArchive& archive) const;
  Json sample_json(const Capture& capture, const Frame& frame,
                   const std::vector<TrainingObject>& objects) const;

  Params params_;
  Host& host_;
  TrainingData training_;
};

}  // namespace diorama
