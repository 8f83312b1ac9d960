// SPDX-License-Identifier: Apache-2.0
#include "stored_lens.h"

namespace diorama {
namespace {

/// Not inlined: where GCC 12 makes two of these conversions at once, it drops them.
[[gnu::noinline]] double single(double value) { return double(float(value)); }

}  // namespace

// The files hold the terms of a projection matrix: what comes out here gives the same terms again.
Camera stored_lens(Camera camera) {
  const double half_width = 0.5 * camera.width;
  const double half_height = 0.5 * camera.height;
  camera.fx = half_width * single(2.0 * camera.fx / camera.width);
  camera.fy = half_height * single(2.0 * camera.fy / camera.height);
  camera.cx = half_width * (1.0 - single(1.0 - 2.0 * camera.cx / camera.width));
  camera.cy = half_height * (1.0 + single(2.0 * camera.cy / camera.height - 1.0));
  for (double& term : camera.distortion) term = single(term);
  for (double& term : camera.fisheye_polynomial) term = single(term);
  // The files hold the full angle in degrees.
  const double full_angle_deg = single(2.0 * camera.fisheye_max_angle_rad * 180.0 / kPi);
  camera.fisheye_max_angle_rad = full_angle_deg * kPi / 360.0;
  return camera;
}

}  // namespace diorama
