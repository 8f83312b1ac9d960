// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/track_agreement.h"

#include <utility>

namespace diorama {

void TrackAgreement::add(const ClipFrame& clip, const std::string& camera, const std::string& name,
                         std::uint32_t track, const std::function<Finding()>& make) {
  if (clip.clip != clip_) {
    end_clip();
    clip_ = clip.clip;
  }
  Pair& pair = cameras_[camera][{name, track}];
  if (++pair.count == 1) pair.finding = make();
}

void TrackAgreement::end_clip() {
  for (auto& [camera, pairs] : cameras_) {
    // The pair that most frames have, of each name and of each track; the first of equal ones.
    std::map<std::string, const Pair*> of_name;
    std::map<std::uint32_t, const Pair*> of_track;
    for (const auto& [key, pair] : pairs) {
      const Pair*& by_name = of_name[key.first];
      const Pair*& by_track = of_track[key.second];
      if (!by_name || pair.count > by_name->count) by_name = &pair;
      if (!by_track || pair.count > by_track->count) by_track = &pair;
    }
    for (auto& [key, pair] : pairs) {
      ++log_.checks;
      const bool is_usual = of_name[key.first] == &pair && of_track[key.second] == &pair;
      if (!is_usual) log_.findings.push_back(pair.finding);
    }
  }
  cameras_.clear();
}

void TrackAgreement::finish(ReadLog& log) {
  end_clip();
  log.add(std::exchange(log_, {}));
}

}  // namespace diorama
