// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "framework/datasets/lens.h"

/// What pose, bounds, mask and depth of one object must have in common, in every format.
namespace diorama::lint {

inline constexpr const char* kReproject = "pose and camera reproject onto the mask";
inline constexpr const char* kBackProject = "depth back-projects";

/// Extent of the box's edges in the image; nothing when the lens does not image all of them.
std::optional<Eigen::AlignedBox2d> projected_extent(const Lens& lens,
                                                    const Affine& camera_from_local,
                                                    const Aabb& bounds);

/// Turns x right, y up, looking along -z into lint's axes.
Affine flipped_axes();

}  // namespace diorama::lint
