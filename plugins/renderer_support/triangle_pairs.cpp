// SPDX-License-Identifier: Apache-2.0
#include "triangle_pairs.h"

#include <algorithm>
#include <bit>

namespace diorama {
namespace {

constexpr std::uint32_t kNone = TrianglePair::kNone;

/// Equal for equal numbers: adding zero leaves no -0.
std::array<std::uint32_t, 3> bits_of(const Vec3f& p) {
  return {std::bit_cast<std::uint32_t>(p.x() + 0.0f), std::bit_cast<std::uint32_t>(p.y() + 0.0f),
          std::bit_cast<std::uint32_t>(p.z() + 0.0f)};
}

std::uint32_t mixed(std::uint32_t bits) {
  bits *= 0x9E3779B1u;
  return bits ^ (bits >> 15);
}

/// Finds the triangle on the other side of each triangle's longest edge.
class Pairing {
 public:
  explicit Pairing(const Mesh& mesh)
      : mesh_(mesh),
        partners_(mesh.triangles.size(), kNone),
        open_(std::bit_ceil(mesh.triangles.size() * 3 / 2 + 1), kNone) {
    std::vector<std::uint32_t> hashes;
    hashes.reserve(mesh.positions.size());
    for (const Vec3f& p : mesh.positions) {
      const auto bits = bits_of(p);
      hashes.push_back(mixed(mixed(mixed(bits[0]) + bits[1]) + bits[2]));
    }
    edges_.reserve(mesh.triangles.size());
    for (const auto& triangle : mesh.triangles) {
      Edge edge = longest_edge(triangle);
      edge.hash = mixed(hashes[edge.begin] + hashes[edge.end]);
      edges_.push_back(edge);
    }
    constexpr std::size_t kAhead = 16;
    for (std::uint32_t t = 0; t < edges_.size(); ++t) {
      const std::size_t later = std::min(t + kAhead, edges_.size() - 1);
      __builtin_prefetch(&open_[place_of(edges_[later])]);
      offer(t);
    }
  }

  std::vector<TrianglePair> pairs() const {
    std::vector<TrianglePair> pairs;
    pairs.reserve(edges_.size());
    for (std::uint32_t t = 0; t < edges_.size(); ++t) {
      const std::uint32_t other = partners_[t];
      if (other == kNone) {
        pairs.push_back({3 * t, kNone});
      } else if (t < other) {
        pairs.push_back({3 * t + edges_[t].tip, 3 * other + edges_[other].tip});
      }
    }
    return pairs;
  }

 private:
  struct Edge {
    std::uint32_t begin = 0;  ///< Vertices, in the triangle's order.
    std::uint32_t end = 0;
    std::uint32_t tip = 0;  ///< The triangle's other corner: 0 to 2.
    std::uint32_t hash = 0;
  };
  std::size_t place_of(const Edge& edge) const { return edge.hash & (open_.size() - 1); }
  Edge longest_edge(const std::array<std::uint32_t, 3>& triangle) const {
    const Vec3f& a = mesh_.positions[triangle[0]];
    const Vec3f& b = mesh_.positions[triangle[1]];
    const Vec3f& c = mesh_.positions[triangle[2]];
    const float bc = (c - b).squaredNorm();
    const float ca = (a - c).squaredNorm();
    const float ab = (b - a).squaredNorm();
    // Without branches, which nobody can foresee.
    const bool is_ab = (ab >= bc) & (ab >= ca);
    const std::uint32_t tip = is_ab ? 2u : std::uint32_t(bc < ca);
    const std::uint32_t begin = next_corner(tip);
    return {triangle[begin], triangle[next_corner(begin)], tip, 0};
  }

  bool meets(std::uint32_t v, std::uint32_t w) const {
    return v == w || bits_of(mesh_.positions[v]) == bits_of(mesh_.positions[w]);
  }

  /// Pairs the triangle with one that waits at its edge, or lets it wait there. An edge has one
  /// place however many triangles share it, so that no input makes long searches.
  void offer(std::uint32_t triangle) {
    const Edge& own = edges_[triangle];
    std::size_t at = place_of(own);
    for (; open_[at] != kNone; at = (at + 1) & (open_.size() - 1)) {
      const std::uint32_t waiting = open_[at];
      const Edge& other = edges_[waiting];
      const bool is_opposite = meets(own.begin, other.end) && meets(own.end, other.begin);
      if (!is_opposite && !(meets(own.begin, other.begin) && meets(own.end, other.end))) continue;
      if (partners_[waiting] != kNone) break;
      if (!is_opposite) return;
      partners_[triangle] = waiting;
      partners_[waiting] = triangle;
      return;
    }
    open_[at] = triangle;
  }

  const Mesh& mesh_;
  std::vector<std::uint32_t> partners_;  ///< Of the triangles.
  std::vector<Edge> edges_;              ///< Of the triangles: their longest.
  /// Open addressing: the last triangle that came to an edge without finding another. Never full.
  std::vector<std::uint32_t> open_;
};

}  // namespace

std::vector<TrianglePair> pair_triangles(const Mesh& mesh) { return Pairing(mesh).pairs(); }

}  // namespace diorama
