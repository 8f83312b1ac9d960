// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// Per triangle the edges across which the surface goes on flat or rises, so that nothing can leave
/// the triangle that way. Edge i runs from corner i to corner i + 1.
struct InnerEdges {
  std::uint8_t bits = 0;
  bool is_inner(int edge, bool from_front) const {
    return (bits >> (from_front ? edge : edge + 3)) & 1;
  }
};

/// Positions that are equal count as one, whatever their index: surfaces split by texture seams are
/// whole here.
std::vector<InnerEdges> find_inner_edges(std::span<const Vec3f> positions,
                                         std::span<const std::array<std::uint32_t, 3>> triangles);

}  // namespace diorama
