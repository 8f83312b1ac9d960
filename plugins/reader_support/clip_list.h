// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/writer.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// The list of clips that our writers put into their pages. Throws std::runtime_error or a JSON
/// exception when it is damaged: clips ascend, do not overlap and have frames.
std::vector<DatasetClip> clips_of_json(const Json& list);

}  // namespace diorama
