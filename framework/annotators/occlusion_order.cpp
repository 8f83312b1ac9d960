// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/occlusion_order.h"

#include <algorithm>

#include "framework/annotators/visibility.h"

namespace diorama {
namespace {

PixelBox shared_box(const PixelBox& a, const PixelBox& b) {
  return {std::max(a.x_min, b.x_min), std::max(a.y_min, b.y_min), std::min(a.x_max, b.x_max),
          std::min(a.y_max, b.y_max)};
}

/// In how many pixels of the image the first of two objects is in front, and the second.
struct Order {
  std::int64_t first = 0;
  std::int64_t second = 0;
};

Order order_of(const CoverageMask& a, std::uint32_t a_id, const CoverageMask& b, std::uint32_t b_id,
               const Image<std::uint32_t>& ids) {
  Order order;
  const PixelBox box = shared_box(a.box, b.box).clipped(ids.width(), ids.height());
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      const std::size_t in_a = a.index(x, y);
      const std::size_t in_b = b.index(x, y);
      if (a.bits[in_a] == 0 || b.bits[in_b] == 0) continue;
      const float a_distance = a.distances[in_a];
      const float b_distance = b.distances[in_b];
      const std::uint32_t seen = ids.at(x, y);
      const bool is_tie = a_distance == b_distance;
      if (a_distance < b_distance || (is_tie && seen == a_id)) ++order.first;
      if (b_distance < a_distance || (is_tie && seen == b_id)) ++order.second;
    }
  }
  return order;
}

void check_distances(std::span<const CoverageMask> coverage, const Frame& frame) {
  for (std::size_t i = 0; i < coverage.size(); ++i) {
    if (coverage[i].distances.size() == coverage[i].bits.size()) continue;
    throw Error(ErrorKind::Internal, frame.camera_path + ": the coverage mask of " +
                                         frame.instances[i].node_path + " has no distances");
  }
}

}  // namespace

void order_occlusions(std::span<const CoverageMask> coverage, Frame& frame) {
  check_coverage(coverage, frame);
  check_distances(coverage, frame);
  const Image<std::uint32_t>& ids = frame.get(kInstanceId);
  const std::vector<Instance>& instances = frame.instances;
  std::vector<std::vector<Occlusion>> behind(instances.size());
  for (std::size_t i = 0; i < instances.size(); ++i) {
    for (std::size_t j = i + 1; j < instances.size(); ++j) {
      const std::uint32_t first = instances[i].id;
      const std::uint32_t second = instances[j].id;
      const Order order = order_of(coverage[i], first, coverage[j], second, ids);
      if (order.first > 0) behind[i].push_back({first, second, order.first});
      if (order.second > 0) behind[j].push_back({second, first, order.second});
    }
  }
  frame.occlusions.clear();
  for (const auto& pairs : behind) {
    frame.occlusions.insert(frame.occlusions.end(), pairs.begin(), pairs.end());
  }
}

}  // namespace diorama
