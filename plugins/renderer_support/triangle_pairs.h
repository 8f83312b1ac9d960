// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diorama/geometry.h"

namespace diorama {

/// Two triangles that share an edge, which they run through in opposite directions, or one alone.
/// Each is named by its tip, the corner that is not on the shared edge: the others follow in the
/// triangle's own order.
struct TrianglePair {
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  /// 3 * triangle + corner both. A triangle that stayed alone has its first corner as its tip.
  std::uint32_t first = kNone;
  std::uint32_t second = kNone;  ///< kNone where the first stayed alone.
};

/// The corner that follows in the same triangle; 3 * triangle + corner both.
inline std::uint32_t next_corner(std::uint32_t corner) {
  return corner % 3 == 2 ? corner - 2 : corner + 1;
}

/// All triangles of a mesh in pairs, each exactly once, in the order of the pairs' lower triangles.
/// Corners meet where their positions are equal, also on seams, where they are different vertices.
/// Only triangles with a common longest edge are paired: the box around both is hardly larger than
/// the boxes around each.
std::vector<TrianglePair> pair_triangles(const Mesh& mesh);

}  // namespace diorama
