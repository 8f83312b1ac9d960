// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/camera_params.h"

#include "writer_support/camera_matrices.h"

namespace diorama {
namespace {

/// Numbers that pass through 32-bit floats in the format.
double single(double value) { return double(float(value)); }

template <class Values>
Json single_list(const Values& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(single(value));
  return list;
}

Json lens_polynomial(const Camera& camera) {
  if (camera.lens == LensModel::FisheyePolynomial) return single_list(camera.fisheye_polynomial);
  if (camera.lens == LensModel::OpencvPinhole) {
    const auto& k = camera.distortion;  // k1 k2 p1 p2 k3 k4 k5 k6
    return single_list(std::array{k[0], k[1], k[4], k[5], k[6], k[7]});
  }
  return single_list(std::array{0.0, 0.0, 0.0, 0.0, 0.0});
}

Json tangential_terms(const Camera& camera) {
  if (camera.lens != LensModel::OpencvPinhole) return Json::array();
  return single_list(std::array{camera.distortion[2], camera.distortion[3]});
}

}  // namespace

Json camera_params_json(const Frame& frame) {
  const Camera& camera = frame.camera;
  const bool has_lens = camera.lens != LensModel::Pinhole;
  const bool is_opencv = camera.lens == LensModel::OpencvPinhole;
  const bool is_fisheye = camera.lens == LensModel::FisheyePolynomial;
  const Vec2 aperture = aperture_mm(camera);
  const Vec2 offset = aperture_offset_mm(camera);
  Json json = Json::object();
  json["cameraAperture"] = single_list(aperture);
  json["cameraApertureOffset"] = single_list(offset);
  json["cameraFisheyeLensP"] = tangential_terms(camera);
  json["cameraFisheyeLensS"] = Json::array();
  json["cameraFisheyeMaxFOV"] =
      is_fisheye ? single(2.0 * camera.fisheye_max_angle_rad * 180.0 / kPi) : 0.0;
  json["cameraFisheyeNominalHeight"] = has_lens ? camera.height : 0;
  json["cameraFisheyeNominalWidth"] = has_lens ? camera.width : 0;
  json["cameraFisheyeOpticalCentre"] =
      has_lens ? single_list(std::array{camera.cx, camera.cy}) : single_list(std::array{0.0, 0.0});
  json["cameraFisheyePolynomial"] = lens_polynomial(camera);
  json["cameraFocalLength"] = single(focal_length_mm(camera));
  json["cameraFocusDistance"] = single(camera.focus_distance_m);
  json["cameraFStop"] = single(camera.f_stop);
  json["cameraModel"] = replicator_camera_model(camera);
  json["cameraNearFar"] = single_list(std::array{camera.near_m, camera.far_m});
  if (is_opencv) {
    json["cameraOpenCVFx"] = single(camera.fx);
    json["cameraOpenCVFy"] = single(camera.fy);
  }
  json["cameraProjection"] = flat_list(projection_matrix(camera).cast<float>());
  json["cameraViewTransform"] = flat_list(view_matrix(frame).cast<float>());
  json["metersPerSceneUnit"] = 1.0;
  json["renderProductResolution"] = {camera.width, camera.height};
  return json;
}

}  // namespace diorama
