// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// The parts of a mask whose pixels are connected by edges.
struct MaskParts {
  /// One number per pixel, row by row: 0 outside of the mask, else the part's, from 1 on in the
  /// order of their first pixels.
  std::vector<std::int32_t> part;
  std::vector<PixelBox> boxes;      ///< Of part i + 1, in pixels of the mask.
  std::vector<std::int64_t> sizes;  ///< Pixels of part i + 1.
};

/// `bits` are one byte per pixel, 0 outside.
MaskParts connected_parts(std::span<const std::uint8_t> bits, int width, int height);

}  // namespace diorama
