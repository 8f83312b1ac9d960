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

/// Counts that grow with the levels, for who has asked. Levels are 0 to 3, or shares.
inline void tell_levels(const NameSet& wanted, double occlusion, double truncation,
                        Instance& instance) {
  const bool is_asked = wanted.contains(std::string_view(kAskOcclusionLevels)) ||
                        wanted.contains(std::string_view(kAskTruncationLevels));
  if (!is_asked) return;
  constexpr double kWhole = 1000.0;
  const auto part = [](double level) {
    return std::llround(kWhole * std::clamp(0.25 * level, 0.0, 1.0));
  };
  Visibility& seen = instance.visibility.emplace();
  seen.amodal_pixels = std::llround(kWhole);
  seen.visible_pixels = seen.amodal_pixels - part(occlusion);
  seen.outside_pixels = part(truncation);
}

}  // namespace diorama
