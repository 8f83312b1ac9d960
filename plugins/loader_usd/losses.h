// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>

namespace diorama::loader_usd {

/// What a prim says and the scene does not get, in words that follow the prim's path: "has ...".
/// The words name no numbers, so that prims with the same fault share a warning.
using Losses = std::set<std::string>;

}  // namespace diorama::loader_usd
