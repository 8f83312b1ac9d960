// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/frame.h"
#include "diorama/math.h"

// Cameras as USD and Replicator describe them. All matrices here are row-vector matrices:
// [x y z 1] * M, the translation in the last row.
namespace diorama {

Mat4 row_vector_matrix(const Affine& map);

/// World to camera space.
Mat4 view_matrix(const Frame& frame);

/// Camera to clip space with reversed depth: 1 at the near plane, 0 at the far plane. The pixel
/// follows as ((x / w + 1) / 2 * width, (1 - y / w) / 2 * height). Lens distortion has no place in
/// it.
Mat4 projection_matrix(const Camera& camera);

/// "pinhole", "pinholeOpenCV", "fisheyePolynomial".
const char* replicator_camera_model(const Camera& camera);

/// Millimetres, horizontal and vertical, of square pixels.
Vec2 aperture_mm(const Camera& camera);
/// Shift of the aperture's centre against the axis, millimetres, x right, y up.
Vec2 aperture_offset_mm(const Camera& camera);
/// The focal length that goes with fx and the aperture.
double focal_length_mm(const Camera& camera);

}  // namespace diorama
