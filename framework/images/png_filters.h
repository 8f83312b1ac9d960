// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace diorama::images {

/// Undoes the filters of PNG (ISO/IEC 15948, 9.2) in `height` rows that each stand behind the
/// number of theirs, and appends their pixels. `stride` bytes lie between a pixel and its left
/// neighbour, 1 to 4. False for numbers that mean nothing.
bool undo_png_filters(std::span<const std::uint8_t> rows, std::size_t height, std::size_t stride,
                      std::vector<std::uint8_t>& pixels);

}  // namespace diorama::images
