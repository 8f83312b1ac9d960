// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/math.h"
#include "loader_usd/usd/matrix.h"

namespace diorama::loader_usd {

/// The same map for column vectors. What a matrix has of perspective is left out.
inline Affine to_affine(const usd::Matrix& matrix) {
  Affine affine = Affine::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      affine.linear()(row, column) = matrix.at(column, row);
    }
    affine.translation()(row) = matrix.at(3, row);
  }
  return affine;
}

/// Turns a scene with y up into one with z up.
inline Affine z_up_from_y_up() { return Affine(Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitX())); }

}  // namespace diorama::loader_usd
