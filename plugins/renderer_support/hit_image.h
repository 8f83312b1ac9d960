// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "huge_pages.h"
#include "mesh_instance.h"

namespace diorama {

/// What the rays through a picture's pixels met, row by row.
class HitImage {
 public:
  HitImage() = default;
  /// Without values as yet.
  HitImage(int width, int height)
      : width_(std::size_t(width)), hits_(width_ * std::size_t(height)) {}

  bool is_empty() const { return hits_.size() == 0; }
  RayHit& at(int x, int y) { return hits_.data()[std::size_t(y) * width_ + std::size_t(x)]; }
  const RayHit& at(int x, int y) const {
    return hits_.data()[std::size_t(y) * width_ + std::size_t(x)];
  }

 private:
  std::size_t width_ = 0;
  HugePages<RayHit> hits_;
};

}  // namespace diorama
