// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "diorama/config.h"
#include "diorama/image.h"

namespace diorama {

/// A CSS colour name in any case ("green" is (0, 128, 0)), "#rgb", "#rgba", "#rrggbb" or
/// "#rrggbbaa"; nothing when it is none of these.
std::optional<Rgba8> color_from_text(std::string_view text);

/// A colour in a job file: a text as above, or a list of three or four integers in [0, 255]; null
/// is no colour. Throws Error(Config) with the value's place.
std::optional<Rgba8> color_from_value(const Value& value, const std::string& key);

}  // namespace diorama
