// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace diorama::usd {

using Vector3 = std::array<double, 3>;

/// Row major, for row vectors: p' = p * M, the translation is in the last row, and a * b means
/// first a, then b. As USD stores them.
struct Matrix {
  std::array<double, 16> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

  double& at(int row, int column) { return m[static_cast<std::size_t>(row * 4 + column)]; }
  double at(int row, int column) const { return m[static_cast<std::size_t>(row * 4 + column)]; }
  friend bool operator==(const Matrix&, const Matrix&) = default;
};

Matrix operator*(const Matrix& a, const Matrix& b);
Vector3 transform(const Matrix& matrix, const Vector3& point);
Matrix translation(const Vector3& offset);
Matrix scaling(const Vector3& factors);
/// About x (0), y (1) or z (2).
Matrix rotation(int axis, double degrees);
/// i, j, k, real. By OpenUSD's rule for those that are not of unit length: the real part is the
/// cosine of half the angle, the others are the direction of the axis.
Matrix rotation(const std::array<double, 4>& quaternion);
/// The identity for a matrix that has no inverse.
Matrix inverse(const Matrix& matrix);

/// A box along the axes; empty as long as nothing was added.
struct Box {
  Vector3 min{1, 1, 1};
  Vector3 max{-1, -1, -1};
  bool is_empty() const { return min[0] > max[0] || min[1] > max[1] || min[2] > max[2]; }
  void add(const Vector3& point);
  void add(const Box& box);
};

/// The box of the transformed corners.
Box transform(const Matrix& matrix, const Box& box);

}  // namespace diorama::usd
