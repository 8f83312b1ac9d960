// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diorama/writer.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// The list of clips that our writers put into their pages. Throws std::runtime_error or a JSON
/// exception when it is damaged: clips ascend, do not overlap and have frames.
std::vector<DatasetClip> clips_of_json(const Json& list);

/// Finds what a picture says of its place in a clip (add_clip_frame of writers) when the dataset's
/// page says otherwise.
void check_clip_frame(const Json& picture, std::span<const DatasetClip> clips, int capture,
                      StoredFiles& files, const std::string& file, const std::string& who);

}  // namespace diorama
