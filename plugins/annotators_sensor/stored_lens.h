// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"

namespace diorama {

/// The lens as BasicWriter's camera_params files hold it, in numbers of 32 bits. Sensors work with
/// nothing else, so that they make the same bytes during a run and from a stored dataset.
Camera stored_lens(Camera camera);

}  // namespace diorama
