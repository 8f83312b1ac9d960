// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// Triangles in node space. Immutable once it is in a scene and shared by every instance of an
/// asset; consumers recognise a mesh by its address. Counter-clockwise triangles face the viewer.
struct DIORAMA_SDK_API Mesh {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Indices into positions.
  /// One per position, unit length; empty: flat shading by the geometric normal.
  std::vector<Vec3f> normals;
  /// One per position, (0, 0) is the lower left of a texture; empty: untextured.
  std::vector<Vec2f> uvs;
  /// One per position, linear RGB, multiplies the base colour; empty: white.
  std::vector<Vec3f> colors;
  /// One per triangle: index into Node::materials; empty: every triangle uses slot 0.
  std::vector<std::uint16_t> material_slots;
  /// False: rays pass through the back side of opaque single-sided surfaces only in viewers that
  /// cull; Diorama's renderers always shade both sides and use this for light emission.
  bool is_double_sided = true;

  Aabb bounds() const;  ///< Of the positions; O(n).
  /// Throws Error(Asset) beginning with `name` when a list has the wrong length, an index is out of
  /// range or a number is not finite.
  void validate(const std::string& name) const;
};

/// Area-weighted vertex normals; a vertex of only degenerate triangles gets +z.
DIORAMA_SDK_API std::vector<Vec3f> smooth_normals(const Mesh& mesh);

/// Closed primitive meshes, centred at the origin, with normals and uvs.
DIORAMA_SDK_API Mesh make_box(const Vec3& size);
DIORAMA_SDK_API Mesh make_sphere(double radius, int segments = 48);
/// Axis along z; `height` is the whole height for the cone and the cylinder, and the part between
/// the half spheres for the capsule.
DIORAMA_SDK_API Mesh make_cylinder(double radius, double height, int segments = 48);
DIORAMA_SDK_API Mesh make_cone(double radius, double height, int segments = 48);
DIORAMA_SDK_API Mesh make_capsule(double radius, double height, int segments = 48);
/// In the xy plane, facing +z.
DIORAMA_SDK_API Mesh make_plane(double width, double length);

}  // namespace diorama
