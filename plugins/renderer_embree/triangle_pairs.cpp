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
        tips_(mesh.triangles.size()),
        open_(std::bit_ceil(2 * mesh.triangles.size()), kNone) {
    hashes_.reserve(mesh.positions.size());
    for (const Vec3f& p : mesh.positions) {
      const auto bits = bits_of(p);
      hashes_.push_back(mixed(mixed(mixed(bits[0]) + bits[1]) + bits[2]));
    }
    for (std::uint32_t t = 0; t < tips_.size(); ++t) {
      tips_[t] = 3 * t + opposite_of_longest_edge(mesh.triangles[t]);
      offer(t);
    }
  }

  std::vector<TrianglePair> pairs() const {
    std::vector<TrianglePair> pairs;
    pairs.reserve(tips_.size());
    for (std::uint32_t t = 0; t < tips_.size(); ++t) {
      if (partners_[t] == kNone) {
        pairs.push_back({3 * t, kNone});
      } else if (t < partners_[t]) {
        pairs.push_back({tips_[t], tips_[partners_[t]]});
      }
    }
    return pairs;
  }

 private:
  std::uint32_t opposite_of_longest_edge(const std::array<std::uint32_t, 3>& triangle) const {
    const Vec3f& a = mesh_.positions[triangle[0]];
    const Vec3f& b = mesh_.positions[triangle[1]];
    const Vec3f& c = mesh_.positions[triangle[2]];
    const float bc = (c - b).squaredNorm();
    const float ca = (a - c).squaredNorm();
    const float ab = (b - a).squaredNorm();
    if (ab >= bc && ab >= ca) return 2;
    return bc >= ca ? 0 : 1;
  }

  std::uint32_t vertex(std::uint32_t corner) const {
    return mesh_.triangles[corner / 3][corner % 3];
  }
  bool meets(std::uint32_t v, std::uint32_t w) const {
    return v == w || bits_of(mesh_.positions[v]) == bits_of(mesh_.positions[w]);
  }

  /// Pairs the triangle with one that waits at its edge, or lets it wait there. An edge has one
  /// place however many triangles share it, so that no input makes long searches.
  void offer(std::uint32_t triangle) {
    const std::uint32_t begin = vertex(next_corner(tips_[triangle]));
    const std::uint32_t end = vertex(next_corner(next_corner(tips_[triangle])));
    std::size_t at = mixed(hashes_[begin] + hashes_[end]) & (open_.size() - 1);
    for (; open_[at] != kNone; at = (at + 1) & (open_.size() - 1)) {
      const std::uint32_t other = open_[at];
      const std::uint32_t other_begin = vertex(next_corner(tips_[other]));
      const std::uint32_t other_end = vertex(next_corner(next_corner(tips_[other])));
      const bool is_opposite = meets(begin, other_end) && meets(end, other_begin);
      if (!is_opposite && !(meets(begin, other_begin) && meets(end, other_end))) continue;
      if (partners_[other] != kNone) break;
      if (!is_opposite) return;
      partners_[triangle] = other;
      partners_[other] = triangle;
      return;
    }
    open_[at] = triangle;
  }

  const Mesh& mesh_;
  std::vector<std::uint32_t> hashes_;    ///< Of the positions.
  std::vector<std::uint32_t> partners_;  ///< Of the triangles.
  std::vector<std::uint32_t> tips_;      ///< Of the triangles, opposite their longest edges.
  /// Open addressing: the last triangle that came to an edge without finding another.
  std::vector<std::uint32_t> open_;
};

}  // namespace

std::vector<TrianglePair> pair_triangles(const Mesh& mesh) { return Pairing(mesh).pairs(); }

}  // namespace diorama
