// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "diorama/reader.h"

namespace diorama {

/// Whether what one source calls an object in all frames of a clip is what another source calls
/// it: a track is one node, a node one track. Frames of a clip come one after the other; names are
/// remembered for one clip at a time.
class TrackAgreement {
 public:
  /// `make` is called when the pair is new: it says what is wrong if the pair is.
  void add(const ClipFrame& clip, const std::string& camera, const std::string& name,
           std::uint32_t track, const std::function<Finding()>& make);
  /// What contradicts most frames of its clip goes to the log.
  void finish(ReadLog& log);

 private:
  struct Pair {
    std::int64_t count = 0;
    Finding finding;
  };
  /// Of one camera in the clip at hand.
  using Pairs = std::map<std::pair<std::string, std::uint32_t>, Pair>;
  void end_clip();

  int clip_ = -1;
  std::map<std::string, Pairs> cameras_;
  ReadLog log_;
};

}  // namespace diorama
