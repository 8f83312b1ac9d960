// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diorama/camera.h"
#include "diorama/frame.h"
#include "diorama/geometry.h"
#include "diorama/math.h"
#include "isa.h"

namespace diorama {

/// The pixels whose centre rays meet any of some triangles, through a pinhole: found triangle by
/// triangle and row by row instead of ray by ray, which costs next to nothing for large things.
/// Neighbouring triangles leave no gap between them. The same pixels with any instruction set.
class Silhouette {
 public:
  /// Pixels of `box` only, which may reach beyond the image.
  Silhouette(const Camera& camera, const PixelBox& box, bool with_distances, Isa isa);

  /// A mesh at a pose in the world.
  void add(const Mesh& mesh, const Eigen::Matrix3f& linear, const Vec3f& translation,
           const Affine& camera_from_world);

  /// What was covered, in the whole box. Leaves nothing behind.
  CoverageMask take();

 private:
  /// Numbers of up to four edges, corners or sides of a box.
  using Four [[gnu::vector_size(32)]] = double;
  using FourInts [[gnu::vector_size(16)]] = std::int32_t;
  struct Corner {
    Vec3 position;  ///< In camera space.
    double depth() const { return -position.z(); }
  };
  /// Not below zero on one side of straight lines of the picture.
  template <class Number>
  struct Lines {
    Number per_column{};
    Number per_row{};
    Number at_origin{};
  };
  using Line = Lines<double>;
  /// Pixels of one row, both ends included.
  struct Span {
    int first;
    int last;
  };

  /// In the world.
  struct Placed {
    const std::vector<Vec3f>& positions;
    const Eigen::Matrix3f& linear;
    const Vec3f& translation;
  };
  void place(const Placed& mesh, const Affine& camera_from_world);
  void place_avx2(const Placed& mesh, const Affine& camera_from_world);
  void add_all(const std::vector<std::array<std::uint32_t, 3>>& triangles);
  void add_all_avx2(const std::vector<std::array<std::uint32_t, 3>>& triangles);
  FourInts reach_of(const Corner& corner) const;
  void add_triangle(const PixelBox& around, const Corner& a, const Corner& b, const Corner& c);
  template <class Number>
  Lines<Number> lines_of(const Number& x, const Number& y, const Number& z) const;
  static void narrow(const Lines<Four>& edges, int row, Span& span);
  static void narrow(const Line& line, int row, Span& span);
  void fill(int row, const Span& span, const Line& nearness);

  const Camera& camera_;
  Vec2 per_focal_length_;
  PixelBox box_;
  bool has_distances_;
  bool has_avx2_;
  std::vector<Corner> corners_;
  /// By corner: the pixels around it as -x_min, -y_min, x_max, y_max.
  std::vector<FourInts> reaches_;
  std::vector<std::uint8_t> bits_;
  std::vector<float> nearness_;  ///< 1 / depth of what is nearest; empty without distances.
};

}  // namespace diorama
