// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// Corners between pixels; (0, 0) is the top left corner of the image.
using Polygon = std::vector<Vec2>;

/// A 4-connected part of a mask. All polygons run along pixel edges.
struct Outline {
  Polygon outer;               ///< Clockwise on the screen.
  std::vector<Polygon> holes;  ///< Counter-clockwise; those that touch at a corner are two.
};

/// The parts of `id`'s pixels inside `box`, the largest outer polygon first.
std::vector<Outline> outlines(const Image<std::uint32_t>& ids, std::uint32_t id,
                              const PixelBox& box);

/// One polygon of a part or of several, holes included, joined by bridges of no width between
/// nearest corners. Even-odd and non-zero winding fill it alike.
Polygon joined(const Outline& part);
Polygon joined(const std::vector<Outline>& parts);

/// The rectangle of least area round all points, corners clockwise on the screen from the one
/// nearest to the image's top left corner on.
std::array<Vec2, 4> least_rectangle(const std::vector<Outline>& parts);

}  // namespace diorama
