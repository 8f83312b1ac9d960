// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// Leaves an object those keypoints that are wanted: of what its asset brought along, and of the
/// file beside it (keypoints_file()), which counts first. `root` is the asset's own node below the
/// object. Throws Error(Asset) when the file is wrong, or none of them is there.
void keep_keypoints(Scene& scene, NodeId object, NodeId root, const std::string& asset,
                    const std::vector<std::string>& wanted);

}  // namespace diorama
