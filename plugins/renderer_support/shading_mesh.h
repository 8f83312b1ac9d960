// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diorama/geometry.h"
#include "triangle_pairs.h"

namespace diorama {

/// What tracing and shading read of a mesh, shared by its instances.
///
/// Triangles are paired to quads, for engines that trace them two by two, and numbered by them:
/// 2 * quad for the first half, 2 * quad + 1 for the second. A triangle's
/// corners begin with its tip, see TrianglePair; the weights u and v of a point belong to the
/// second and third.
///
/// A triangle without a partner has both numbers, by the second with its last two corners
/// exchanged: rounding may put a hit on its last edge beyond it, and still finds the same place
/// there.
class ShadingMesh {
 public:
  explicit ShadingMesh(std::shared_ptr<const Mesh> mesh);
  /// Puts the uvs of every triangle beside each other, if it has any: for meshes with textures,
  /// whose uvs are read often. Not beside any other use.
  void pack_uvs();

  const Mesh& source() const { return *source_; }
  const std::shared_ptr<const Mesh>& shared_source() const { return source_; }
  /// Vertices of the source.
  const std::vector<std::array<std::uint32_t, 4>>& quads() const { return quads_; }

  struct Point {
    std::uint32_t triangle = 0;
    float u = 0.0f;
    float v = 0.0f;
  };
  /// All numbers are below.
  std::uint32_t number_end() const { return std::uint32_t(tips_.size()); }
  /// Whether this is the second number of a triangle without a partner.
  bool is_repeated(std::uint32_t triangle) const {
    return triangle % 2 == 1 && tips_[triangle] == tips_[triangle - 1];
  }
  /// Vertices of the source.
  std::array<std::uint32_t, 3> corners(std::uint32_t triangle) const;
  std::size_t slot(std::uint32_t triangle) const { return triangles_[triangle].slot; }
  std::size_t highest_slot() const { return highest_slot_; }
  bool has_normals() const { return !source_->normals.empty(); }
  bool has_uvs() const { return !source_->uvs.empty(); }
  /// Interpolated, in node space, not unit length; only with has_normals().
  Vec3f normal(std::uint32_t triangle, float u, float v) const {
    const auto& n = triangles_[triangle].normals;
    const float w = 1.0f - u - v;
    return {w * float(n[0]) + u * float(n[3]) + v * float(n[6]),
            w * float(n[1]) + u * float(n[4]) + v * float(n[7]),
            w * float(n[2]) + u * float(n[5]) + v * float(n[8])};
  }
  /// Starts to fetch a triangle's record from memory.
  void prefetch(std::uint32_t triangle) const { __builtin_prefetch(&triangles_[triangle]); }
  void prefetch_uvs(std::uint32_t triangle) const {
    if (!uvs_.empty()) __builtin_prefetch(&uvs_[triangle]);
  }
  /// Of the three corners; only with has_uvs().
  std::array<Vec2f, 3> uvs(std::uint32_t triangle) const {
    return uvs_.empty() ? source_uvs(triangle) : uvs_[triangle];
  }

  struct Triangle {
    std::array<std::int16_t, 9> normals{};  ///< Of the corners, 32767 long.
    std::uint16_t slot = 0;                 ///< Of its material.
  };
  /// By their numbers.
  const std::vector<Triangle>& triangles() const { return triangles_; }

 private:
  std::array<Vec2f, 3> source_uvs(std::uint32_t triangle) const {
    const auto [a, b, c] = corners(triangle);
    return {source_->uvs[a], source_->uvs[b], source_->uvs[c]};
  }

  std::shared_ptr<const Mesh> source_;
  std::vector<std::uint32_t> tips_;  ///< Of the triangles.
  std::vector<std::array<std::uint32_t, 4>> quads_;
  std::vector<Triangle> triangles_;
  std::vector<std::array<Vec2f, 3>> uvs_;  ///< Empty unless packed.
  std::size_t highest_slot_ = 0;
};

inline std::array<std::uint32_t, 3> ShadingMesh::corners(std::uint32_t triangle) const {
  const auto& vertices = source_->triangles[tips_[triangle] / 3];
  const std::uint32_t a = tips_[triangle] % 3;
  const std::uint32_t b = next_corner(a);
  const std::uint32_t c = next_corner(b);
  if (is_repeated(triangle)) return {vertices[a], vertices[c], vertices[b]};
  return {vertices[a], vertices[b], vertices[c]};
}

}  // namespace diorama
