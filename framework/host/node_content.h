// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/scene.h"

namespace diorama {

/// Copies what a node holds: visibility, labels, mesh, materials, light, camera, collider, body,
/// keypoints, joint and animation, but neither its name nor its place in the tree or in space.
/// Shared data stays shared; the joint leads to the same ids.
void copy_content(const Node& from, Node& to);

/// The first name or label at and below `top` that datasets cannot hold as it is, see
/// is_clean_name(); empty when there is none.
std::string first_unclean_word(const Scene& scene, NodeId top);

/// Makes the labels of a node fit for datasets.
void clean_labels(Node& node);

}  // namespace diorama
