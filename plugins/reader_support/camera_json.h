// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/camera.h"
#include "diorama/frame.h"
#include "diorama/math.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// Reads the entry "lens" that our writers put beside intrinsics; a missing one is a pinhole.
/// Throws std::runtime_error or a JSON exception when it is damaged.
void read_lens_entry(const Json& holder, Camera& camera);

/// Row by row: four by four numbers in nested lists, the last row 0 0 0 1. Throws the same.
Affine affine_of_rows(const Json& rows);

/// Three finite numbers. Throws the same.
Vec3 vector_of_json(const Json& list);

/// Reads "world_from_node", "bounds_min" and "bounds_max" of our writers. What they were not told
/// is not there: the bounds, or all three. Throws the same.
void read_pose_entry(const Json& object, Instance& instance);

/// Throws std::runtime_error unless it turns and shifts alone. `name` is for the message.
void require_rigid(const Affine& map, const std::string& name);

/// Focal lengths of a camera that can see: finite and positive. Throws std::runtime_error.
void require_usable(const Camera& camera);

}  // namespace diorama
