// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "writer_bop/bop_model.h"

namespace diorama {

/// Rotations that leave a model's surface where it was, in the model's space and unit.
struct ModelSymmetries {
  struct Axis {
    Vec3 direction;
    Vec3 point;  ///< On the axis, the one nearest to the origin.
  };
  std::vector<Axis> continuous;  ///< Any angle about these; three for a sphere.
  std::vector<Affine> discrete;  ///< Without the identity; with a continuous axis the turn-over.
};

/// Found by trying: every turned point must be within `tolerance` of the surface. Only the shape
/// counts; colours are not looked at. Axes go through the surface's centre and along its principal
/// axes, and where those are not unique, along what directions the shape has.
ModelSymmetries find_symmetries(const BopModel& model, double tolerance);

}  // namespace diorama
