// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/export/usd_layer.h"

namespace diorama::usd_export {

/// The layer as text. Numbers are the shortest that read back as they were.
std::string write_usda(const Layer& layer);

}  // namespace diorama::usd_export
