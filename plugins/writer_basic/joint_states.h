// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/frame.h"
#include "writer_support/python_json.h"

namespace diorama {

/// The content of joint_states_NNNN.json.
Json joint_states_json(const Frame& frame);

/// The same back. Throws std::exception with what is wrong.
std::vector<JointState> joint_states_from(const Json& json);

}  // namespace diorama
