// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/camera.h"
#include "diorama/host.h"
#include "diorama/image.h"
#include "diorama/math.h"

namespace diorama {

/// The pixels of a camera in square blocks, each with a cone around its rays: says quickly which
/// pixels cannot see a sphere, through any lens.
class RayBlocks {
 public:
  /// Covers the image and one image size to each side of it.
  RayBlocks(const Camera& camera, Host& host);

  /// A box around all pixels whose ray may meet the sphere; the centre is in camera space.
  PixelBox box_of(const Vec3& centre, double radius) const;

 private:
  struct Cone {
    Vec3 axis = Vec3::Zero();  ///< Zero: the lens images nothing here.
    double angle = 0.0;        ///< Between the axis and any ray of the block, radians.
  };
  Cone cone_of(const Camera& camera, const PixelBox& block, bool& is_whole) const;
  PixelBox block(std::size_t index) const;

  PixelBox all_;
  int columns_ = 0;
  std::vector<Cone> cones_;
};

}  // namespace diorama
