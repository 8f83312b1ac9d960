// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/channel_list.h"
#include "writer_support/replicator.h"
#include "writer_support/semantic_filter.h"

namespace diorama {

/// Files as Omniverse Replicator's BasicWriter 0.0.2 writes them: names, folders, types, JSON text.
/// Beyond it, `channels` are written as arrays: disparity_0007.npy; `velocities` as JSON; and of
/// clips clips.json says which frames they have.
class BasicWriter final : public Writer {
 public:
  struct Params {
    bool rgb = false;
    bool bounding_box_2d_tight = false;
    bool bounding_box_2d_loose = false;
    bool semantic_segmentation = false;
    bool instance_id_segmentation = false;
    bool instance_segmentation = false;
    bool distance_to_camera = false;
    bool distance_to_image_plane = false;
    bool bounding_box_3d = false;
    bool occlusion = false;
    bool normals = false;
    bool motion_vectors = false;
    bool camera_params = false;
    bool joint_states = false;
    bool pointcloud = false;
    bool skeleton_data = false;
    bool pointcloud_include_unlabelled = false;
    bool sensor_depth = false;
    bool velocities = false;
    ChannelList channels;
    std::string image_output_format = "png";
    bool colorize_semantic_segmentation = true;
    bool colorize_instance_id_segmentation = true;
    bool colorize_instance_segmentation = true;
    bool colorize_depth = false;
    int frame_padding = 4;
    Value semantic_types;  ///< A list of texts or null.
    std::optional<std::string> semantic_filter_predicate;
    bool use_common_output_dir = false;
    std::string no_instance_text = "INVALID";
    RemoteOutput remote;

    void visit(ParamVisitor& v);
  };

  BasicWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  Params params_;
  Host& host_;
  SemanticFilter filter_;
  int frame_padding_;
  std::vector<Labels> known_labels_;
};

}  // namespace diorama
