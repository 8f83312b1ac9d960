// SPDX-License-Identifier: Apache-2.0
#include "triangle_edges.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace diorama {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// Sine of the angle by which a neighbour may fall away and still count as flat.
constexpr double kFlat = 0.1;

struct Edge {
  std::uint32_t low;
  std::uint32_t high;
  std::uint32_t triangle;
  int index;
};

/// The first of all equal positions, for each.
std::vector<std::uint32_t> welded(std::span<const Vec3f> positions) {
  std::vector<std::uint32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](std::uint32_t i) {
    const Vec3f& p = positions[i];
    return std::make_tuple(p.x(), p.y(), p.z(), i);
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  std::vector<std::uint32_t> first(positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_same = i > 0 && positions[order[i]] == positions[order[i - 1]];
    first[order[i]] = is_same ? first[order[i - 1]] : order[i];
  }
  return first;
}

std::vector<Edge> sorted_edges(std::span<const Triangle> triangles,
                               const std::vector<std::uint32_t>& first) {
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = first[triangles[t][std::size_t(i)]];
      const std::uint32_t b = first[triangles[t][std::size_t((i + 1) % 3)]];
      edges.push_back({std::min(a, b), std::max(a, b), t, i});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.triangle, a.index) <
           std::tie(b.low, b.high, b.triangle, b.index);
  });
  return edges;
}

/// Sine of the angle by which the neighbour rises out of the plane of `edge.triangle`.
double rise(std::span<const Vec3f> positions, std::span<const Triangle> triangles, const Edge& edge,
            const Edge& neighbour) {
  const auto corner = [&](const Edge& at, int i) {
    return Vec3(positions[triangles[at.triangle][std::size_t((at.index + i) % 3)]].cast<double>());
  };
  const Vec3 a = corner(edge, 0);
  const Vec3 along = (corner(edge, 1) - a).normalized();
  const Vec3 normal = along.cross(corner(edge, 2) - a).normalized();
  const Vec3 to_far = corner(neighbour, 2) - a;
  return normal.dot((to_far - along * along.dot(to_far)).normalized());
}

}  // namespace

std::vector<InnerEdges> find_inner_edges(std::span<const Vec3f> positions,
                                         std::span<const Triangle> triangles) {
  std::vector<InnerEdges> inner(triangles.size());
  const std::vector<Edge> edges = sorted_edges(triangles, welded(positions));
  for (std::size_t begin = 0; begin < edges.size();) {
    std::size_t end = begin + 1;
    while (end < edges.size() && edges[end].low == edges[begin].low &&
           edges[end].high == edges[begin].high) {
      ++end;
    }
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t k = begin; k < end; ++k) {
        if (edges[i].triangle == edges[k].triangle) continue;
        const double angle = rise(positions, triangles, edges[i], edges[k]);
        std::uint8_t& bits = inner[edges[i].triangle].bits;
        if (angle > -kFlat) bits = std::uint8_t(bits | 1 << edges[i].index);
        if (angle < kFlat) bits = std::uint8_t(bits | 1 << (edges[i].index + 3));
      }
    }
    begin = end;
  }
  return inner;
}

}  // namespace diorama
