// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// Names of checks that several parts report under, as a report shows them.
inline constexpr const char* kFilesCanBeRead = "every file can be read";
inline constexpr const char* kNothingIsMissing = "nothing is missing";
inline constexpr const char* kCountsAgree = "counts agree between files";

}  // namespace diorama
