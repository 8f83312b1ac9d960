// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "writer_basic/frame_output.h"

namespace diorama {

/// One id and one colour per distinct label set.
void write_semantic_segmentation(const FrameOutput& output, bool colorize);
/// One id per labelled node, with two mapping files.
void write_instance_segmentation(const FrameOutput& output, bool colorize);
/// One id per node with a mesh, labelled or not; `no_instance_text` stands for the background.
void write_instance_id_segmentation(const FrameOutput& output, bool colorize,
                                    const std::string& no_instance_text);

}  // namespace diorama
