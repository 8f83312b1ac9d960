// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// The colour that Replicator gives a segmentation id: 0 is transparent black, 1 opaque black,
/// every other id a saturated colour of its own.
Rgba8 segmentation_color(std::uint32_t id);

/// "(r, g, b, a)", the key of colourised segmentation files.
std::string color_text(const Rgba8& color);

/// Colours of the ids of one picture, no two alike: where two ids would share a colour, the larger
/// one takes the colour of the next id whose colour is free.
std::map<std::uint32_t, Rgba8> distinct_colors(const std::set<std::uint32_t>& ids);

}  // namespace diorama
