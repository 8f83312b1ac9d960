// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// The shape of an object as BOP's tools read it: one list of triangles in the space of the
/// object's node, millimetres, with normals and sRGB colours per vertex.
struct BopModel {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;
  std::vector<std::array<std::uint8_t, 3>> colors;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  bool is_empty() const { return triangles.empty(); }
  Aabb bounds() const;
  /// The largest distance between two vertices.
  double diameter() const;
  /// The same stretched along its axes; no factor may be 0. Negative ones mirror.
  BopModel scaled(const Vec3& factors) const;
  /// A binary little-endian PLY file.
  std::vector<std::byte> ply() const;
};

/// The visible meshes at and below `root`. Colours are those of the base colour at the vertices.
BopModel bop_model(const Scene& scene, NodeId root);

}  // namespace diorama
