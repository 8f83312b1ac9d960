// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// Corners between pixels; (0, 0) is the top left corner of the image.
using Polygon = std::vector<Vec2>;

/// Outlines of the 4-connected parts of `id`'s pixels inside `box`, clockwise on the screen,
/// largest first. They run along pixel edges; holes are filled.
std::vector<Polygon> outlines(const Image<std::uint32_t>& ids, std::uint32_t id,
                              const PixelBox& box);

/// One polygon of several, joined by bridges of no width between nearest corners.
Polygon joined(const std::vector<Polygon>& parts);

/// The rectangle of least area round all points, corners clockwise on the screen.
std::array<Vec2, 4> least_rectangle(const std::vector<Polygon>& parts);

}  // namespace diorama
