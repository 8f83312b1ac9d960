// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "writer_pose/pose_data.h"
#include "writer_support/python_json.h"

namespace diorama {

/// The whole content of one NNNNNN.json.
Json pose_json(const Frame& frame, const std::vector<ObjectPose>& objects,
               const PoseFormat& format);

}  // namespace diorama
