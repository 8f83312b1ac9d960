// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "sobol.h"

namespace diorama {

/// A rectangle of pixels and the samples wanted of each.
struct TraceJob {
  int x_begin = 0;
  int y_begin = 0;
  int x_end = 0;
  int y_end = 0;
  std::uint32_t sample_begin = 0;
  std::uint32_t sample_end = 1;
  SampleOrder order{0, 1};

  std::uint32_t pixel_count() const { return std::uint32_t((x_end - x_begin) * (y_end - y_begin)); }
  std::uint64_t path_count() const {
    return std::uint64_t(pixel_count()) * (sample_end - sample_begin);
  }
};

}  // namespace diorama
