// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "diorama/math.h"

namespace diorama::lint {

/// The pixels of a picture that polygons cover.
class PolygonMasks {
 public:
  PolygonMasks(int width, int height)
      : width_(width), height_(height), first_owner_(std::size_t(width) * std::size_t(height), 0) {}

  /// Adds a polygon (pixels; even-odd rule, a pixel counts by its centre) and returns how many
  /// pixels of the picture it covers.
  int add(const std::vector<Vec2>& polygon);

  /// Pixels that two polygons claim. What lies whole in a hole of another one does not count:
  /// polygons cannot say that they have holes.
  int contested() const;

 private:
  /// Pixels of a polygon, in the box that it extends over.
  struct Mask {
    int x = 0;
    int y = 0;
    int width = 0;
    int height = 0;
    std::vector<int> values;  ///< 0 outside of the polygon.
  };
  Mask mask_of(const std::vector<Vec2>& polygon) const;
  void number_parts(Mask& mask);
  void claim(std::size_t pixel, int part);

  int width_;
  int height_;
  /// Parts are what is connected by edges, numbered from 1 over all polygons.
  std::vector<int> part_sizes_{0};
  std::vector<int> first_owner_;
  std::multimap<std::size_t, int> other_owners_;
  std::map<std::pair<int, int>, int> shared_;
};

}  // namespace diorama::lint
