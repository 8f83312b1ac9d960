// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/math.h"

namespace diorama {

using Rigid = Eigen::Isometry3d;

/// An affine map as a stretch followed by a rigid motion: map = rigid * stretch. Engines move rigid
/// things only; scale, shear and mirroring go into the shapes.
struct RigidStretch {
  Rigid rigid = Rigid::Identity();
  /// Symmetric; negative definite for a mirroring map. Rounded to 24 bits, so that copies of an
  /// asset in different poses have equal stretches although their matrices differ in the last bits.
  Mat3 stretch = Mat3::Identity();
};

RigidStretch split_rigid(const Affine& map);

/// The map's rotation may have lost orthonormality through long products; this restores it.
Rigid to_rigid(const Mat3& rotation, const Vec3& translation);

}  // namespace diorama
