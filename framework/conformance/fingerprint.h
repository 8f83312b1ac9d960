// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama::conformance {

/// All content as bytes: equal exactly when nothing that a component could notice differs.
/// Addresses and revisions do not count.
std::string fingerprint(const Scene& scene);
std::string fingerprint(const Node& node);  ///< Its name and its place in the tree do not count.
std::string fingerprint(const Frame& frame);
std::string fingerprint(const Capture& capture);

/// Paths of the nodes whose content differs; "the tree of nodes" when that differs.
std::vector<std::string> changed_nodes(const Scene& before, const Scene& after);

/// Throws Error(Plugin) with `failure` and the changed nodes unless both scenes are the same.
void require_same(const Scene& before, const Scene& after, const std::string& failure);

}  // namespace diorama::conformance
