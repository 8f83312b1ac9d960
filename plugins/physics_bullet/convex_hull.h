// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// A closed convex polyhedron; triangles are counter-clockwise seen from outside.
struct ConvexHull {
  std::vector<Vec3> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The hull of the points; without triangles when they span no volume.
ConvexHull convex_hull(std::span<const Vec3> points);

/// The corners of a hull of at most `max_points` (14 or more) points out of `points`: first the
/// farthest in fourteen directions, then again and again those that stand out most from the hull of
/// the chosen ones.
std::vector<Vec3> reduced_hull_points(std::span<const Vec3> points, std::size_t max_points);

/// The same points when they span at least `thickness` in every direction; else each of them twice,
/// so far apart along the directions that lack it. Makes solids of sheets and wires.
std::vector<Vec3> thickened(std::span<const Vec3> points, double thickness);

/// The smallest distance from the point to a face plane; negative when it lies outside.
double inner_distance(const ConvexHull& hull, const Vec3& point);

}  // namespace diorama
