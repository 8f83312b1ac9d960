// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/scene.h"

namespace diorama::loader_support {

/// A body and where a joint is to it.
struct JointEnd {
  NodeId body;
  Affine body_from_joint = Affine::Identity();
};

/// Makes `node` the joint of two bodies: one of the axes and limits of `axes`, or, of several, a
/// node with a joint each below it, from the parent to the child, called `names`. Slides come
/// first. The bodies have their poses and sizes, and so has the node; frames begin at the parent,
/// see place_frames(). False, and nothing made: they are where no number says.
bool add_joint(Scene& scene, NodeId node, std::vector<Joint> axes,
               const std::vector<std::string>& names, const JointEnd& parent,
               const JointEnd& child);

}  // namespace diorama::loader_support
