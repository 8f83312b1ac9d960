// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/reader.h"

namespace diorama {

/// In what a frame that was read differs from the one that was written, one line each; nothing when
/// it is the same as far as the dataset holds it and as exactly as it says (StoredInfo::steps).
/// Ids may be others as long as the same pixels share one; objects that were not written may lack.
std::vector<std::string> frame_differences(const StoredInfo& info, const Frame& written,
                                           const Frame& read);

}  // namespace diorama
