// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "diorama/writer.h"
#include "writer_support/python_json.h"

namespace diorama {

/// A list of {"clip", "first_capture", "frame_count", "fps"}; frame `f` of a clip is its capture
/// first_capture + f, and its time f / fps seconds.
Json clips_json(std::span<const DatasetClip> clips);

/// Puts "clip", "frame_index" and "time_s" (since the clip's first frame) into what a format says
/// of one picture; nothing for captures that stand alone.
void add_clip_frame(const Capture& capture, Json& json);

}  // namespace diorama
