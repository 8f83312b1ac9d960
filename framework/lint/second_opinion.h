// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/reader.h"

namespace diorama {

/// Checks poses against pixels by OpenCV's formulas of cameras, a second opinion beside those of
/// lint, as far as frames hold both, and adds to the log:
/// - the surface that a pixel shows projects onto it: world positions and the camera's pose,
///   object coordinates and the object's pose;
/// - a 3-D box reaches no farther than its object: something of the object is at each of its sides.
/// Several threads may call it.
void check_second_opinion(const StoredInfo& info, StoredCapture& stored);

}  // namespace diorama
