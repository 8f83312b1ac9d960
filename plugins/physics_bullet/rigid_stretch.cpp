// SPDX-License-Identifier: Apache-2.0
#include "rigid_stretch.h"

#include <Eigen/SVD>

namespace diorama {
namespace {

Mat3 rounded(const Mat3& stretch) {
  const double largest = stretch.cwiseAbs().maxCoeff();
  Mat3 result;
  for (int i = 0; i < 9; ++i) {
    const double value = stretch(i);
    result(i) = std::abs(value) < 1e-7 * largest ? 0.0 : double(float(value));
  }
  return result;
}

}  // namespace

RigidStretch split_rigid(const Affine& map) {
  const Eigen::JacobiSVD<Mat3> svd(map.linear(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 rotation = svd.matrixU() * svd.matrixV().transpose();
  Mat3 stretch = svd.matrixV() * svd.singularValues().asDiagonal() * svd.matrixV().transpose();
  if (rotation.determinant() < 0.0) {
    rotation = -rotation;
    stretch = -stretch;
  }
  RigidStretch result;
  result.rigid = to_rigid(rotation, map.translation());
  result.stretch = rounded(0.5 * (stretch + stretch.transpose()));
  return result;
}

Rigid to_rigid(const Mat3& rotation, const Vec3& translation) {
  Rigid rigid = Rigid::Identity();
  rigid.linear() = Quat(rotation).normalized().toRotationMatrix();
  rigid.translation() = translation;
  return rigid;
}

}  // namespace diorama
