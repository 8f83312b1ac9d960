// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama::loader_usd {

/// Splits a polygon into triangles of its own corners (0 ... n-1), keeping its winding. Concave,
/// slightly bent and degenerate polygons are fine: there are always n - 2 triangles.
void triangulate(std::span<const Vec3f> corners,
                 std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace diorama::loader_usd
