// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// The unit (ParamDoc::unit) of a parameter that is a pattern of node paths, or a list of such:
/// `v.param("nodes", nodes, {"Nodes to move.", kNodePattern})`. The host then tells a job whose
/// pattern can fit nothing before anything is loaded, and names the nearest path.
inline constexpr const char* kNodePattern = "node pattern";

}  // namespace diorama
