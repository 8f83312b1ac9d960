// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/writer.h"
#include "writer_support/label_sets.h"

namespace diorama {

/// How the files of one capture are named.
struct FrameNaming {
  bool has_many_cameras = false;  ///< One camera: files lie flat in the output folder.
  bool use_common_output_dir = false;
  std::string number;  ///< "0007".

  /// "rp_cam_0/rgb/rgb_0007.png"; `ending` with its dot.
  std::string path(const Frame& frame, std::string_view annotator, std::string_view stem,
                   std::string_view ending) const;
};

/// All that the files of one frame are made from.
struct FrameOutput {
  const Host& host;
  const Frame& frame;
  const FrameNaming& naming;
  const std::map<Labels, std::uint32_t>& semantic_ids;  ///< Of the capture, from 2 on.
  std::vector<FilteredInstance> instances;              ///< Labelled as far as the filter goes.
  CaptureFiles& files;

  std::string path(std::string_view annotator, std::string_view stem,
                   std::string_view ending) const {
    return naming.path(frame, annotator, stem, ending);
  }
};

/// Ids of the pictures: nothing was hit; something without a label that counts.
inline constexpr std::uint32_t kBackgroundId = 0;
inline constexpr std::uint32_t kUnlabelledId = 1;
inline constexpr std::uint32_t kFirstLabelledId = 2;

/// Id of the i-th of FrameOutput::instances in instance pictures.
inline std::uint32_t instance_picture_id(std::size_t i) {
  return kFirstLabelledId + std::uint32_t(i);
}

/// The frame's instance ids replaced by `picture_ids`; pixels of other instances and of unlabelled
/// surfaces become kUnlabelledId, pixels without a surface kBackgroundId.
Image<std::uint32_t> instance_picture(const Frame& frame,
                                      const std::map<std::uint32_t, std::uint32_t>& picture_ids);

/// Picture ids by instance id, for both segmentations by label.
std::map<std::uint32_t, std::uint32_t> semantic_picture_ids(const FrameOutput& output);
std::map<std::uint32_t, std::uint32_t> instance_picture_ids(const FrameOutput& output);

}  // namespace diorama
