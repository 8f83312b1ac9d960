// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diorama/camera.h"
#include "diorama/frame.h"
#include "diorama/math.h"

namespace diorama {

/// The pixels whose centre rays meet any of some triangles, through a pinhole: found triangle by
/// triangle and row by row instead of ray by ray, which costs next to nothing for large things.
/// Neighbouring triangles leave no gap between them.
class Silhouette {
 public:
  /// Pixels of `box` only, which may reach beyond the image.
  Silhouette(const Camera& camera, const PixelBox& box, bool with_distances);

  /// `positions`: x, y, z of each vertex in the world.
  void add(const std::vector<std::array<std::uint32_t, 3>>& triangles,
           const std::vector<float>& positions, std::size_t vertex_count,
           const Affine& camera_from_world);

  /// What was covered, in the whole box. Leaves nothing behind.
  CoverageMask take();

 private:
  struct Corner {
    Vec3 position;  ///< In camera space.
    Vec2 pixel;     ///< Only in front of the camera.
    double depth() const { return -position.z(); }
  };
  /// Not below zero on one side of a straight line of the picture.
  struct Line {
    double per_column = 0.0;
    double per_row = 0.0;
    double at_origin = 0.0;
  };
  /// Pixels of one row, both ends included.
  struct Span {
    int first;
    int last;
  };

  void add_triangle(const Corner& a, const Corner& b, const Corner& c);
  PixelBox pixels_around(const Corner& a, const Corner& b, const Corner& c) const;
  Line line_of(const Vec3& normal) const;
  static void narrow(const Line& line, int row, Span& span);
  void fill(int row, const Span& span, const Line& nearness);

  const Camera& camera_;
  Vec2 per_focal_length_;
  PixelBox box_;
  bool has_distances_;
  std::vector<Corner> corners_;
  std::vector<std::uint8_t> bits_;
  std::vector<float> nearness_;  ///< 1 / depth of what is nearest; empty without distances.
};

}  // namespace diorama
