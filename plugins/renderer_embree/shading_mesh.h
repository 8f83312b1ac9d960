// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diorama/geometry.h"

namespace diorama {

/// What shading reads of a mesh, close together per triangle. Shared by its instances.
class ShadingMesh {
 public:
  explicit ShadingMesh(std::shared_ptr<const Mesh> mesh);

  const Mesh& source() const { return *source_; }
  std::size_t slot(std::uint32_t triangle) const { return triangles_[triangle].slot; }
  std::size_t highest_slot() const { return highest_slot_; }
  bool has_normals() const { return !source_->normals.empty(); }
  bool has_uvs() const { return !uvs_.empty(); }
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
  /// Of the three corners; only with has_uvs().
  const std::array<Vec2f, 3>& uvs(std::uint32_t triangle) const { return uvs_[triangle]; }

 private:
  struct Triangle {
    std::array<std::int16_t, 9> normals{};  ///< Of the corners, 32767 long.
    std::uint16_t slot = 0;                 ///< Of its material.
  };
  std::vector<Triangle> triangles_;
  std::vector<std::array<Vec2f, 3>> uvs_;
  std::size_t highest_slot_ = 0;
  std::shared_ptr<const Mesh> source_;
};

}  // namespace diorama
