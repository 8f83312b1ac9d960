// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

namespace diorama::lint {

/// Names and contents of the members of a tar archive. Throws std::runtime_error when a header is
/// damaged, a member is cut short or the end is missing.
std::map<std::string, std::string> read_tar(const std::string& tar);

}  // namespace diorama::lint
