// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "diorama/reader.h"

namespace diorama {

/// What capture_json() shows: all that a dataset holds but pixels.
NameSet wanted_for_labels(const StoredInfo& info);

/// Everything that labels say of a capture, for the page: cameras, objects with boxes, visibility
/// and poses, and the edges of 3-D boxes projected by the camera's own lens. Texts are as the
/// dataset has them.
std::string capture_json(const StoredInfo& info, const StoredCapture& stored);

/// Amodal masks of a frame: per object a box and the lengths of runs, outside first, row by row.
std::string amodal_json(const Frame& frame);
/// The same of StoredCapture::masks.
std::string masks_json(const std::map<std::uint32_t, CoverageMask>& masks);

}  // namespace diorama
