// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "diorama/geometry.h"

namespace diorama {

/// Finds the triangle of a mesh that a point of its surface lies on. Keeps a reference to the mesh.
class TriangleGrid {
 public:
  explicit TriangleGrid(const Mesh& mesh);

  struct Place {
    std::uint32_t triangle = 0;
    std::array<double, 3> weights{};  ///< Of the corners; they add up to 1.
  };
  /// The place on the surface nearest to a point of node space that lies on it but for rounding;
  /// nothing where no triangle is near.
  std::optional<Place> place_of(const Vec3& point) const;

 private:
  using Cell = std::array<int, 3>;
  Aabb bounds_of(std::size_t triangle) const;
  Cell cell_of(const Vec3& point) const;
  std::size_t number_of(const Cell& cell) const;
  template <class Visit>
  void for_each_cell(const Aabb& box, const Visit& visit) const;
  std::size_t choose_cells(int along_longest);

  const Mesh& mesh_;
  Aabb bounds_;
  double margin_ = 0.0;
  double cell_size_ = 1.0;
  Cell cells_{1, 1, 1};
  std::vector<std::size_t> begins_;  ///< By cell, and the end of the last one.
  std::vector<std::uint32_t> triangles_;
};

}  // namespace diorama
