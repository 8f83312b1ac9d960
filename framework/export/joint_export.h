// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "diorama/scene.h"
#include "framework/export/usd_layer.h"

namespace diorama::usd_export {

/// Turns the prims of joints into joints of UsdPhysics, those of several axes into one. `paths`: of
/// the prim of each node that is exported, `top` the first of them; joints that lead elsewhere are
/// left out. Joints that mimic others are free.
void add_joints(const Scene& scene, const std::map<NodeId, std::string>& paths, Prim& top);

}  // namespace diorama::usd_export
