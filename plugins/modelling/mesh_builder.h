// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "diorama/geometry.h"

namespace diorama::modelling {

/// How the next parts of a mesh are dressed.
struct Surface {
  std::uint16_t slot = 0;         ///< Material slot.
  double repeats_per_m = 1.0;     ///< Of the texture; shapes lay uvs in metres.
  Vec2 uv_offset = Vec2::Zero();  ///< In repeats, so that equal parts do not look stamped.
};

/// Collects parts of one mesh. Parts are given in part space (metres) and put in place by the pose
/// of begin(); a mirroring pose keeps triangles facing outwards.
class MeshBuilder {
 public:
  /// What follows goes through `mesh_from_part` and wears `surface`.
  void begin(const Affine& mesh_from_part, const Surface& surface);

  /// `normal` need not be unit length. `uv_m` is in metres.
  std::uint32_t add_vertex(const Vec3& point, const Vec3& normal, const Vec2& uv_m);
  /// Counter-clockwise seen from outside.
  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
  /// Two triangles; corners counter-clockwise.
  void add_quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d);

  /// Box of all points so far, in mesh space.
  Aabb bounds() const;
  /// Moves everything so that the mean of the vertices is the origin; returns that mean. Exporters
  /// that centre an object's origin do the same.
  Vec3 centre_on_vertex_mean();

  /// The mesh; slivers without area are left out. The builder is empty afterwards.
  std::shared_ptr<const Mesh> build();

 private:
  Mesh mesh_;
  Affine mesh_from_part_ = Affine::Identity();
  Mat3 normal_matrix_ = Mat3::Identity();
  bool is_mirrored_ = false;
  Surface surface_;
};

/// Poses as parts need them.
Affine at(double x, double y, double z);
Affine at(const Vec3& point);
Affine turned_x(double radians);
Affine turned_y(double radians);
Affine turned_z(double radians);
Affine scaled(double x, double y, double z);

}  // namespace diorama::modelling
