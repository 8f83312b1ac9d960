// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "diorama/reader.h"

/// What lint asks of formats that know less than shares; "Reading a dataset back" in
/// sdk/docs/writing_a_plugin.md says what the names mean.
namespace diorama {

inline constexpr const char* kHoldsTracks = "tracks";
inline constexpr const char* kAskOcclusionLevels = "occlusion_levels";
inline constexpr const char* kAskTruncationLevels = "truncation_levels";
inline constexpr const char* kAskSeenShares = "seen_shares";
inline constexpr const char* kAskCamerasOfPairs = "cameras_of_pairs";

/// Counts for who has asked: of a whole object this share is hidden, and this one outside of the
/// picture. Of levels: the middle of what each stands for.
inline void tell_levels(const NameSet& wanted, double hidden, double cut_off, Instance& instance) {
  const bool is_asked = wanted.contains(std::string_view(kAskOcclusionLevels)) ||
                        wanted.contains(std::string_view(kAskTruncationLevels));
  if (!is_asked) return;
  constexpr double kInside = 1e6;
  constexpr double kMost = 0.999;
  const double outside = std::clamp(cut_off, 0.0, kMost);
  Visibility& seen = instance.visibility.emplace();
  seen.amodal_pixels = std::llround(kInside);
  seen.visible_pixels = std::llround(kInside * (1.0 - std::clamp(hidden, 0.0, kMost)));
  seen.outside_pixels = std::llround(kInside * outside / (1.0 - outside));
}

}  // namespace diorama
