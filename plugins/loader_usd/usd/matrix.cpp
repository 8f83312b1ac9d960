// SPDX-License-Identifier: Apache-2.0
#include "matrix.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace diorama::usd {

Matrix operator*(const Matrix& a, const Matrix& b) {
  Matrix result;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      double sum = 0.0;
      for (int i = 0; i < 4; ++i) sum += a.at(row, i) * b.at(i, column);
      result.at(row, column) = sum;
    }
  }
  return result;
}

Vector3 transform(const Matrix& matrix, const Vector3& point) {
  std::array<double, 4> result{};
  for (int column = 0; column < 4; ++column) {
    result[static_cast<std::size_t>(column)] =
        point[0] * matrix.at(0, column) + point[1] * matrix.at(1, column) +
        point[2] * matrix.at(2, column) + matrix.at(3, column);
  }
  const double w = result[3] == 0.0 ? 1.0 : result[3];
  if (w == 1.0) return {result[0], result[1], result[2]};
  return {result[0] / w, result[1] / w, result[2] / w};
}

Matrix translation(const Vector3& offset) {
  Matrix result;
  for (int i = 0; i < 3; ++i) result.at(3, i) = offset[static_cast<std::size_t>(i)];
  return result;
}

Matrix scaling(const Vector3& factors) {
  Matrix result;
  for (int i = 0; i < 3; ++i) result.at(i, i) = factors[static_cast<std::size_t>(i)];
  return result;
}

Matrix rotation(int axis, double degrees) {
  const double angle = degrees * std::numbers::pi / 180.0;
  const int u = (axis + 1) % 3;
  const int v = (axis + 2) % 3;
  Matrix result;
  result.at(u, u) = result.at(v, v) = std::cos(angle);
  result.at(u, v) = std::sin(angle);
  result.at(v, u) = -std::sin(angle);
  return result;
}

Matrix rotation(const std::array<double, 4>& quaternion) {
  constexpr double kLeastAxis = 1e-10;
  const double length = std::hypot(quaternion[0], quaternion[1], quaternion[2]);
  if (length <= kLeastAxis) return {};
  const double w = std::clamp(quaternion[3], -1.0, 1.0);
  const double share = std::sqrt(1.0 - w * w) / length;
  const double x = quaternion[0] * share;
  const double y = quaternion[1] * share;
  const double z = quaternion[2] * share;
  Matrix result;
  result.m = {1 - 2 * (y * y + z * z),
              2 * (x * y + z * w),
              2 * (z * x - y * w),
              0,
              2 * (x * y - z * w),
              1 - 2 * (z * z + x * x),
              2 * (y * z + x * w),
              0,
              2 * (z * x + y * w),
              2 * (y * z - x * w),
              1 - 2 * (y * y + x * x),
              0,
              0,
              0,
              0,
              1};
  return result;
}

Matrix inverse(const Matrix& matrix) {
  // Gauss-Jordan with the biggest pivot of each column.
  Matrix left = matrix;
  Matrix right;
  for (int column = 0; column < 4; ++column) {
    int pivot = column;
    for (int row = column + 1; row < 4; ++row) {
      if (std::abs(left.at(row, column)) > std::abs(left.at(pivot, column))) pivot = row;
    }
    if (!(std::abs(left.at(pivot, column)) > 0.0)) return {};
    for (int i = 0; i < 4; ++i) {
      std::swap(left.at(pivot, i), left.at(column, i));
      std::swap(right.at(pivot, i), right.at(column, i));
    }
    const double factor = 1.0 / left.at(column, column);
    for (int i = 0; i < 4; ++i) {
      left.at(column, i) *= factor;
      right.at(column, i) *= factor;
    }
    for (int row = 0; row < 4; ++row) {
      if (row == column) continue;
      const double share = left.at(row, column);
      for (int i = 0; i < 4; ++i) {
        left.at(row, i) -= share * left.at(column, i);
        right.at(row, i) -= share * right.at(column, i);
      }
    }
  }
  return right;
}

void Box::add(const Vector3& point) {
  if (is_empty()) {
    min = max = point;
    return;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    min[i] = std::min(min[i], point[i]);
    max[i] = std::max(max[i], point[i]);
  }
}

void Box::add(const Box& box) {
  if (box.is_empty()) return;
  add(box.min);
  add(box.max);
}

Box transform(const Matrix& matrix, const Box& box) {
  Box result;
  if (box.is_empty()) return result;
  for (int corner = 0; corner < 8; ++corner) {
    result.add(transform(
        matrix, Vector3{corner & 1 ? box.max[0] : box.min[0], corner & 2 ? box.max[1] : box.min[1],
                        corner & 4 ? box.max[2] : box.min[2]}));
  }
  return result;
}

}  // namespace diorama::usd
