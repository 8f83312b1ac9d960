// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_coco/coco_categories.h"
#include "writer_support/class_choice.h"
#include "writer_support/named_keypoints.h"
#include "writer_support/replicator.h"
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
/// compressed run lengths of the visible pixels, or polygons along pixel edges, one per part, holes
/// joined to their border by bridges of no width. Every picture has the first licence. Annotations
/// with fewer visible pixels than
/// `crowd_below_px` are marked iscrowd, so that an evaluation ignores them instead of punishing a
/// detector for either answer.
///
/// Of clips, images have video_id, frame_index and time_s, and annotations a track_id, which is
/// that of the same object in all frames of a clip. With `youtube_vis` youtube_vis/{train,val}.json
/// lists videos, one per clip and camera, and tracks with a mask per frame; its pictures are those
/// in images/{train,val}.
///
/// The keywords of Replicator's writer of the same name are understood: the categories, the choice
/// of labels, the licences and the format of pictures. What stands for names and places of files
/// there has no effect and is named in the log.
class CocoWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool keypoints = true;
    bool amodal = true;
    bool panoptic = true;
    bool youtube_vis = false;
    std::string segmentation = "rle";
    int crowd_below_px = 0;
    Value coco_categories;    ///< See read_coco_categories().
    Value coco_license_info;  ///< A list of {id, name, url} or null.
    std::optional<std::string> image_output_format;
    std::optional<std::string> dataset_id;
    std::optional<double> frame_padding;
    ReplicatorLabels labels;
    RemoteOutput remote;

    void visit(ParamVisitor& v);
  };

  CocoWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  int category_id(int class_index) const;
  Json categories() const;
  Json segmentation_json(const Frame& frame, const Instance& instance, bool is_crowd) const;
  Json annotation(const Frame& frame, const TrainingObject& object, int image_id) const;
  Json panoptic_annotation(const Frame& frame, const std::vector<TrainingObject>& objects,
                           int image_id, const std::string& stem, const char* split,
                           CaptureFiles& files) const;

  Json video_frame(const Capture& capture, std::size_t camera, const std::string& file,
                   const std::vector<TrainingObject>& objects) const;
  void write_videos(const RecordReader& records, DatasetFiles& files);

  Params params_;
  Host& host_;
  bool has_clips_ = false;
  std::vector<CocoCategory> categories_;  ///< Of coco_categories; empty: classes count from 1.
  Json licenses_;
  TrainingData training_;
  NamedKeypoints keypoints_;
};

}  // namespace diorama
