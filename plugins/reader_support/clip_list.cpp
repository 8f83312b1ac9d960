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

}  // namespace diorama
