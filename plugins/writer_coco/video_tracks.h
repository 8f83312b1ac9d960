// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "writer_coco/coco_tables.h"

namespace diorama {

/// What is kept of an annotation with a track until all images are known; texts as digests, as
/// there may be millions.
struct TrackedAnnotation {
  std::int64_t image_id = 0;
  std::uint32_t track = 0;
  std::uint64_t node = 0;
  std::uint64_t box = 0;   ///< Category, box and area.
  std::uint64_t mask = 0;  ///< 0: no run lengths.
};

TrackedAnnotation tracked_annotation(const Json& annotation);

/// Checks what our writer says of clips: a track is one node of its clip, and the files of
/// youtube_vis/, where they are there, tell the same of each frame as the annotations.
void check_video_tracks(const std::filesystem::path& folder, const CocoTables& tables,
                        const DatasetPage& page, const std::vector<TrackedAnnotation>& annotations,
                        StoredFiles& files);

}  // namespace diorama
