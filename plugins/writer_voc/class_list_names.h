// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace diorama {

/// Names of classes as parts of the names of their lists, all different.
std::vector<std::string> class_list_names(const std::vector<std::string>& classes);

}  // namespace diorama
