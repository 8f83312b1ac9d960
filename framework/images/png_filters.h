// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace diorama::images {

/// Undoes the filters of PNG (ISO/IEC 15948, 9.2) in rows that each stand behind the number of
/// theirs. `stride` bytes lie between a pixel and its left neighbour, 1 to 4. False for numbers
/// that mean nothing; `rows` must hold `height` rows, `pixels` has what they take without numbers.
bool undo_png_filters(std::span<const std::uint8_t> rows, std::size_t height, std::size_t stride,
                      std::span<std::uint8_t> pixels);

}  // namespace diorama::images
