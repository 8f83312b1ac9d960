// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/class_choice.h"
#include "writer_support/replicator.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The KITTI object benchmark (Geiger et al., CVPR 2012):
///
///     dataset.json ImageSets/{train,val,trainval}.txt
///     training/image_2/000024.png  label_2/000024.txt  calib/000024.txt  depth_2/000024.png
///              image_3/000024.png
///
/// Cameras take turns: number = capture x cameras + camera. With the layout `stereo` they go by
/// twos, left before right: the right one's picture is image_3, its projection P3 (and P1) with the
/// baseline, and all else is the left one's. Boxes are upright in the camera's own space (x right,
/// y down, z forward): turned about y by the object's heading and wide enough to hold its box;
/// `location` is the middle of the bottom face. Depth is 16 bit, metres x 256, 0 where nothing is
/// or beyond 255.99 m. KITTI's pictures are rectified: for another lens than a pinhole the
/// calibration has a line of ours, `lens_2`, with JSON text.
///
/// With the layout `tracking` it is the tracking benchmark, whose sequences are the clips of each
/// camera; number = clip x cameras + camera, and the files of a sequence's frames count from 0:
///
///     training/image_02/0003/000024.png  label_02/0003.txt  calib/0003.txt
///     depth_02/0003/000024.png
///
/// Lines of label_02 begin with frame and track, which is the number of the object's node;
/// truncation is 0 (none), 1 or 2 (more than half).
///
/// The keywords of Replicator's writer of the same name are understood: the choice of labels and
/// the thresholds. What it says of segmentation pictures and names of folders has no effect and is
/// named in the log.
class KittiWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool depth = true;
    std::string layout = "mono";
    int bbox_height_threshold = 0;
    double fully_visible_threshold = 0.95;
    double partly_occluded_threshold = 0.5;
    bool omit_semantic_type = true;
    bool use_kitti_dir_names = true;
    bool colorize_instance_segmentation = false;
    std::optional<std::string> mapping_path;
    Value mapping_dict;
    Value renderproduct_idxs;
    ReplicatorLabels labels;
    RemoteOutput remote;

    void visit(ParamVisitor& v);
  };

  KittiWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& all, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  bool is_stereo() const { return params_.layout == "stereo"; }
  bool is_tracking() const { return params_.layout == "tracking"; }
  void write_clip_frame(const Capture& capture, CaptureFiles& files) const;
  std::string stem(int capture, int camera) const;
  void notice_idle_keywords() const;

  Params params_;
  Host& host_;
  TrainingData training_;
  int padding_ = 6;
};

}  // namespace diorama
