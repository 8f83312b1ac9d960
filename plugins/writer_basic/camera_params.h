// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/frame.h"
#include "writer_support/python_json.h"

namespace diorama {

/// The content of camera_params_NNNN.json.
Json camera_params_json(const Frame& frame);

}  // namespace diorama
