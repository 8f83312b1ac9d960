// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_pose/pose_data.h"
#include "writer_support/replicator.h"
#include "writer_support/semantic_filter.h"

namespace diorama {

/// JSON files of object poses and cuboid keypoints, as Replicator's PoseWriter 0.2.0 writes them.
/// Camera-frame poses are right by default; `compat: replicator` repeats the reference's swapped
/// matrix product, its pixel formulas (no lens distortion) and its principal point. Lenses other
/// than pinholes have an entry of ours, `lens`, in camera_data, which the reference leaves out; so
/// do the names of cameras that take turns in one folder, `cameras`, in metadata.txt, and with
/// `named_keypoints` each object's `named_keypoints`: name, place in the camera frame and in the
/// image, and visibility (0 outside, 1 hidden, 2 visible).
class PoseWriter final : public Writer {
 public:
  struct Params {
    bool use_subfolders = false;
    double visibility_threshold = 0.0;
    bool skip_empty_frames = true;
    bool write_debug_images = false;
    int frame_padding = 6;
    std::optional<std::string> format;
    std::string image_output_format = "png";
    std::string compat = "none";
    bool named_keypoints = false;
    bool use_s3 = false;
    std::optional<std::string> s3_endpoint_url;
    RemoteOutput remote;

    void visit(ParamVisitor& v);
  };

  PoseWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  std::string stem(const Capture& capture, std::size_t camera) const;
  void write_frame(const Capture& capture, const Frame& frame, const std::string& stem,
                   CaptureFiles& files) const;
  void add_picture(const std::string& stem, const Image<Rgba8>& picture, CaptureFiles& files) const;

  Params params_;
  Host& host_;
  PoseFormat format_;
  SemanticFilter filter_;
  int frame_padding_;
};

}  // namespace diorama
