// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <btBulletCollisionCommon.h>

#include <vector>

namespace diorama {

/// A convex hull whose farthest points are found several corners at a time: Bullet's own looks at
/// one after the other, which is half of what contacts of hulls with meshes cost. Finds the same
/// points. Bullet asks shapes of its own kinds without a virtual call, so this is a kind of its
/// own.
class HullShape final : public btConvexHullShape {
 public:
  static constexpr int kShapeType = CUSTOM_POLYHEDRAL_SHAPE_TYPE;

  BT_DECLARE_ALIGNED_ALLOCATOR();

  /// Margins lie outside of the points.
  HullShape(const std::vector<btVector3>& points, double margin);

  btVector3 localGetSupportingVertexWithoutMargin(const btVector3& direction) const override;

 private:
  /// x, y and z of the corners in groups of kLanes, filled up with the first corner.
  std::vector<double> columns_;
};

}  // namespace diorama
