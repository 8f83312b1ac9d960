// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/camera.h"
#include "diorama/image.h"

namespace diorama {

/// Where two views of a scene can be matched. Disparities are pixels, 0 where nothing was hit; the
/// second view (or the projector) stands to the right of the first.
struct StereoMatching {
  double edge_step_px = 1.0;  ///< Neighbours that differ by more lie on different surfaces.
  int edge_radius_px = 2;     ///< Half the window that must lie on one surface.
  double max_incidence_rad = kPi / 2;
};

using PixelMask = Image<std::uint8_t>;  ///< 1 or 0.

/// Pixels that the second view sees, too: nothing nearer hides them there, and they are inside it.
PixelMask seen_by_both(const Image<float>& disparity, const StereoMatching& matching);
/// Pixels whose window lies on one surface.
PixelMask far_from_edges(const Image<float>& disparity, const StereoMatching& matching);
/// Pixels whose surface turns away from the view by no more than the largest incidence. `depth` in
/// metres along the axis, +infinity where nothing was hit.
PixelMask seen_steeply(const Image<float>& depth, const Camera& camera,
                       const StereoMatching& matching);

}  // namespace diorama
