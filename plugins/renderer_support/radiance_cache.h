// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/math.h"

namespace diorama {

/// Light that paths find behind the second surface that they meet, but for that surface's own light
/// sample: means over cells of world space, from some paths for all others of a picture. A path
/// that ends there has a fraction of the noise and fewer rays; what it brings is off by as much as
/// light differs within a cell (path space filtering: Keller, Dahm and Binder 2014; ADR 0099).
/// Const and shareable between threads.
class RadianceCache {
 public:
  /// What a path found at a surface.
  struct Finding {
    Vec3f position = Vec3f::Zero();  ///< World, metres.
    Vec3f normal = Vec3f::Zero();    ///< On the side that the path came from, unit.
    float reach = 0.0f;              ///< Metres from the surface before.
    Vec3f weight = Vec3f::Zero();    ///< Its throughput there times the surface's albedo.
    Vec3f light = Vec3f::Zero();     ///< What it brought to the eye by its further way.
  };

  /// Cells are larger the farther they are from `eye`. Findings count in their order: equal ones
  /// make equal bytes.
  RadianceCache(const Vec3f& eye, std::span<const std::span<const Finding>> findings);

  /// What a weight brings there, as above, to a surface that is `reach` away; false: too little is
  /// known in cells that are no wider than that.
  bool find(const Vec3f& position, const Vec3f& normal, float reach, Vec3f& light) const;

  /// A cell that is known. Cells stand in a table with room for a power of two of them: at the
  /// place that the upper 31 bits of their keys say, or at the next free one behind it.
  struct Cell {
    Vec3f light = Vec3f::Zero();
    std::uint32_t key = 0;  ///< Odd; 0: nothing stands here.
  };
  std::span<const Cell> table() const { return table_; }
  const Vec3f& eye() const { return eye_; }

 private:
  /// Of a cell: a cube, and the axis that normals go along.
  struct Place {
    int exponent = 0;  ///< Of two: its side in metres.
    int side = 0;      ///< x, -x, y, -y, z, -z.
    std::array<int, 3> at{};

    auto operator<=>(const Place&) const = default;
    /// The cell around it that is twice as wide.
    Place parent() const { return {exponent + 1, side, {at[0] >> 1, at[1] >> 1, at[2] >> 1}}; }
    std::uint32_t key() const;
  };
  /// Of the findings of a cell.
  struct Sums {
    Place place;
    int widest = 0;  ///< Exponent of the widest cell that they may count in.
    std::uint32_t count = 0;
    Vec3f weight = Vec3f::Zero();
    Vec3f light = Vec3f::Zero();
  };
  std::vector<Sums> smallest_cells(std::span<const std::span<const Finding>> findings) const;
  static std::vector<Sums> known_cells(std::vector<Sums> cells);
  /// Exponent of the widest cell that counts for a place.
  static int widest(const Place& place, float reach);
  Place place_of(const Vec3f& position, const Vec3f& normal) const;
  std::size_t first_place(std::uint32_t key) const { return (key >> 1) & (table_.size() - 1); }
  void fill(std::span<const Sums> cells);

  Vec3f eye_;
  std::vector<Cell> table_;
};

}  // namespace diorama
