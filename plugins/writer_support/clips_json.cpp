// SPDX-License-Identifier: Apache-2.0
#include "writer_support/clips_json.h"

namespace diorama {

Json clips_json(std::span<const DatasetClip> clips) {
  Json list = Json::array();
  for (const DatasetClip& clip : clips) {
    list.push_back({{"clip", list.size()},
                    {"first_capture", clip.first},
                    {"frame_count", clip.count},
                    {"fps", clip.fps}});
  }
  return list;
}

void add_clip_frame(const Capture& capture, Json& json) {
  if (!capture.clip) return;
  json["clip"] = capture.clip->clip;
  json["frame_index"] = capture.clip->frame;
  json["time_s"] = python_round(capture.clip->time_s(), 9);
}

}  // namespace diorama
