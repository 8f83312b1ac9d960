// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "convex_hull.h"
#include "rigid_stretch.h"

namespace diorama {

/// Volume integrals of a solid of density 1, in the space of its maker.
struct MassProperties {
  double volume = 0.0;
  Vec3 centroid = Vec3::Zero();
  Mat3 second_moment = Mat3::Zero();  ///< Integral of r r^T about the centroid.

  /// About the centroid, for a body of this mass.
  Mat3 inertia(double mass_kg) const;
};

MassProperties mass_of_hull(const ConvexHull& hull);
MassProperties mass_of_box(const Vec3& size);
MassProperties mass_of_sphere(double radius);
/// Axis along z, centred; `height` as in geometry.h.
MassProperties mass_of_cylinder(double radius, double height);
MassProperties mass_of_cone(double radius, double height);
MassProperties mass_of_capsule(double radius, double height);

MassProperties mapped(const MassProperties& solid, const Rigid& b_from_a);
/// Of both solids together; what they share counts twice.
MassProperties combined(const MassProperties& a, const MassProperties& b);

}  // namespace diorama
