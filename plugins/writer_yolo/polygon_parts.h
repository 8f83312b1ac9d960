// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "diorama/frame.h"

namespace diorama {

/// The pixels of a picture that masks cover which cannot have holes: polygons of formats that say
/// one outline. What lies whole in another one is seen through a hole of it.
class PolygonParts {
 public:
  PolygonParts(int width, int height)
      : width_(width), first_owner_(std::size_t(width) * std::size_t(height), 0) {}

  void add(const CoverageMask& mask);

  /// Pixels that two masks claim, other than parts that lie whole in another mask.
  std::int64_t contested() const;

 private:
  void claim(std::size_t pixel, int part);

  int width_;
  /// Parts are what is connected by edges, numbered from 1 over all masks.
  std::vector<std::int64_t> part_sizes_{0};
  std::vector<int> first_owner_;
  std::multimap<std::size_t, int> other_owners_;
  std::map<std::pair<int, int>, std::int64_t> shared_;
};

/// Ids of masks that may lie in holes of others: smaller ones are on top.
Image<std::uint32_t> ids_with_smaller_on_top(const std::vector<CoverageMask>& masks,
                                             const std::vector<std::uint32_t>& ids, int width,
                                             int height);

}  // namespace diorama
