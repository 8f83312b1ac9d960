// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "framework/datasets/lens.h"
#include "framework/datasets/object_checks.h"
#include "numpy_files.h"

/// A second reader of camera_params files, for tests.
namespace diorama::test {

using lint::Lens;

/// A camera as camera_params_NNNN.json describes it.
struct ReplicatorCamera {
  Affine camera_from_world = Affine::Identity();  ///< In the axes of lens.h.
  Lens lens;
};

/// Sixteen numbers for row vectors, as a matrix for column vectors.
inline Mat4 column_matrix(const Json& list) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) matrix(i % 4, i / 4) = list.at(std::size_t(i)).get<double>();
  return matrix;
}

inline void read_distortion(const Json& params, Lens& lens) {
  const std::string model = params.at("cameraModel").get<std::string>();
  const auto polynomial = params.at("cameraFisheyePolynomial").get<std::vector<double>>();
  if (model == "pinholeOpenCV") {
    const auto tangential = params.at("cameraFisheyeLensP").get<std::vector<double>>();
    lens.model = Lens::Model::Opencv;
    lens.distortion = {polynomial.at(0), polynomial.at(1), tangential.at(0), tangential.at(1),
                       polynomial.at(2), polynomial.at(3), polynomial.at(4), polynomial.at(5)};
  } else if (model == "fisheyePolynomial") {
    lens.model = Lens::Model::Fisheye;
    std::copy_n(polynomial.begin(), std::min(polynomial.size(), lens.polynomial.size()),
                lens.polynomial.begin());
    lens.max_angle = params.at("cameraFisheyeMaxFOV").get<double>() * kPi / 360.0;
  } else if (model != "pinhole") {
    throw std::runtime_error("unknown cameraModel '" + model + "'");
  }
}

/// Throws when keys are missing.
inline ReplicatorCamera camera_of(const Json& params) {
  ReplicatorCamera camera;
  Affine camera_from_world;
  camera_from_world.matrix() = column_matrix(params.at("cameraViewTransform"));
  camera.camera_from_world = lint::flipped_axes() * camera_from_world;
  const Mat4 clip_from_camera = column_matrix(params.at("cameraProjection"));
  Lens& lens = camera.lens;
  lens.width = params.at("renderProductResolution").at(0).get<int>();
  lens.height = params.at("renderProductResolution").at(1).get<int>();
  const Vec2 half(0.5 * lens.width, 0.5 * lens.height);
  lens.focal = {half.x() * clip_from_camera(0, 0), half.y() * clip_from_camera(1, 1)};
  lens.centre = {half.x() * (1.0 - clip_from_camera(0, 2)),
                 half.y() * (1.0 + clip_from_camera(1, 2))};
  read_distortion(params, lens);
  return camera;
}

}  // namespace diorama::test
