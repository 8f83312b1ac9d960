// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// Names of checks that several parts report under, as a report shows them.
inline constexpr const char* kFilesCanBeRead = "every file can be read";
inline constexpr const char* kNothingIsMissing = "nothing is missing";
inline constexpr const char* kCountsAgree = "counts agree between files";

// What readers may hold or answer beside the names of diorama/reader.h. Who answers a question says
// so by an entry in StoredInfo::steps, and holds nothing more for it.

/// Held: Instance::id is the same for an object in all frames of a clip, and nobody else's.
inline constexpr const char* kHoldsTracks = "tracks";
/// Levels in place of Visibility::occlusion() and truncation(): shares of counts that lie in the
/// middle of the level. More is more hidden or cut off; how much more is not said, but where the
/// step is below 1: those are shares, rounded to it.
inline constexpr const char* kAskOcclusionLevels = "occlusion_levels";
inline constexpr const char* kAskTruncationLevels = "truncation_levels";
/// Visible pixels as a share of all, hidden and cut off ones too: Visibility has counts of which
/// only that share is true.
inline constexpr const char* kAskSeenShares = "seen_shares";
/// Pictures of some cameras stand beside those of others, whose names are all that is known.
inline constexpr const char* kAskCamerasOfPairs = "cameras_of_pairs";

}  // namespace diorama
