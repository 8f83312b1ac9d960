// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "diorama/image.h"

namespace diorama {

/// What one walk through a picture counts: it is more than the processor's nearer memory holds.
struct ColorCounts {
  std::uint64_t sum = 0;    ///< Of all red, green and blue values.
  std::size_t burnt = 0;    ///< Pixels whose three values are 254 or 255.
  bool is_uniform = false;  ///< All pixels are the same, alpha too.
};

ColorCounts color_counts(std::span<const Rgba8> pixels);

/// How many values are below a limit; NaN is not.
std::size_t count_below(std::span<const float> values, float limit);

}  // namespace diorama
