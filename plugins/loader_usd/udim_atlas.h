// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/material.h"

namespace diorama::loader_usd {

/// A tile of a set of UDIM textures; (0, 0) is tile 1001, columns go along u and rows along v.
struct UdimTile {
  int column = 0;
  int row = 0;
  std::shared_ptr<const Texture> texture;
};

/// Where a rectangle of tiles lies.
struct UdimRange {
  int first_column = 0;
  int first_row = 0;
  int columns = 0;
  int rows = 0;

  /// The range of these tiles, which must not be none.
  static UdimRange of(const std::vector<UdimTile>& tiles);
  /// From mesh uv, in which each tile is one unit, to the atlas.
  Eigen::Matrix<float, 2, 3> atlas_from_uv() const;
};

/// Puts tiles side by side into one texture, each as large as the largest one that is 8 bits per
/// channel. Missing tiles are black. Sets of floating-point tiles give their first tile alone.
std::shared_ptr<const Texture> make_udim_atlas(const std::string& name,
                                               const std::vector<UdimTile>& tiles);

}  // namespace diorama::loader_usd
