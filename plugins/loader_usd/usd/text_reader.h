// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "layer.h"

namespace diorama::usd {

/// Whether the text begins as a usda layer does.
bool is_text_layer(std::string_view text);

/// Reads a usda layer. `identifier` names the file in messages. Throws FormatError with
/// `file:line:column`.
std::shared_ptr<Layer> read_text_layer(const std::string& identifier, std::string_view text);

}  // namespace diorama::usd
