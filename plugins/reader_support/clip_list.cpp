// SPDX-License-Identifier: Apache-2.0
#include "reader_support/clip_list.h"

#include <cmath>
#include <stdexcept>

namespace diorama {

std::vector<DatasetClip> clips_of_json(const Json& list) {
  if (!list.is_array()) throw std::runtime_error("clips are no list");
  std::vector<DatasetClip> clips;
  std::int64_t end = 0;
  for (const Json& entry : list) {
    const auto first = whole_number<std::int64_t>(entry.at("first_capture"));
    const auto count = whole_number<std::int64_t>(entry.at("frame_count"));
    const auto fps = entry.at("fps").get<double>();
    constexpr std::int64_t kMost = 1'000'000'000;
    if (first < end || first > kMost || count < 1 || count > kMost - first) {
      throw std::runtime_error("clip " + std::to_string(clips.size()) +
                               " has captures of the one before it, or none");
    }
    if (!(fps > 0.0 && std::isfinite(fps))) {
      throw std::runtime_error("clip " + std::to_string(clips.size()) + " has no frame rate");
    }
    end = first + count;
    clips.push_back({int(first), int(count), fps});
  }
  return clips;
}

void check_clip_frame(const Json& picture, std::span<const DatasetClip> clips, int capture,
                      StoredFiles& files, const std::string& file, const std::string& who) {
  const auto clip = clip_frame(clips, capture);
  const auto said = [&](const char* key) {
    const auto value = picture.find(key);
    return value == picture.end() ? Json() : Json(*value);
  };
  const Json number = said("clip"), frame = said("frame_index"), time = said("time_s");
  const bool holds = clip ? number == clip->clip && frame == clip->frame && time.is_number() &&
                                std::abs(time.get<double>() - clip->time_s()) <= 1e-8
                          : number.is_null() && frame.is_null() && time.is_null();
  files.check(
      holds, kCounts, file, who,
      "its clip, frame and time are " + number.dump() + ", " + frame.dump() + ", " + time.dump(),
      clip ? std::to_string(clip->clip) + ", " + std::to_string(clip->frame) + ", " +
                 std::to_string(clip->time_s()) + ", as dataset.json says"
           : "none, as dataset.json says");
}

}  // namespace diorama
