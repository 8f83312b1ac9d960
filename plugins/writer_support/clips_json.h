// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "diorama/writer.h"
#include "writer_support/python_json.h"

namespace diorama {

/// A list of {"clip", "first_capture", "frame_count", "fps"}; frame `f` of a clip is its capture
/// first_capture + f, and its time f / fps seconds.
Json clips_json(std::span<const DatasetClip> clips);

}  // namespace diorama
