// SPDX-License-Identifier: Apache-2.0
#include "reader_support/camera_json.h"

#include <cmath>
#include <stdexcept>

namespace diorama {

void read_lens_entry(const Json& holder, Camera& camera) {
  if (!holder.contains("lens")) return;
  const Json& entry = holder.at("lens");
  const std::string model = entry.at("model").get<std::string>();
  if (model == "opencv_pinhole") {
    camera.lens = LensModel::OpencvPinhole;
    camera.distortion = entry.at("distortion").get<std::array<double, 8>>();
  } else if (model == "fisheye_polynomial") {
    camera.lens = LensModel::FisheyePolynomial;
    camera.fisheye_polynomial = entry.at("polynomial").get<std::array<double, 6>>();
    camera.fisheye_max_angle_rad = entry.at("max_angle_rad").get<double>();
  } else if (model != "pinhole") {
    throw std::runtime_error("unknown lens model '" + model + "'");
  }
}

Affine affine_of_rows(const Json& rows) {
  Affine map;
  for (int i = 0; i < 16; ++i) {
    map.matrix()(i / 4, i % 4) = rows.at(std::size_t(i / 4)).at(std::size_t(i % 4)).get<double>();
  }
  if (!map.matrix().allFinite())
    throw std::runtime_error("a matrix has numbers that are not finite");
  if (map.matrix().row(3) != Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)) {
    throw std::runtime_error("the last row of a matrix is not 0 0 0 1");
  }
  return map;
}

Vec3 vector_of_json(const Json& list) {
  const Vec3 v(list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>());
  if (!v.allFinite()) throw std::runtime_error("a vector has numbers that are not finite");
  return v;
}

void read_pose_entry(const Json& object, Instance& instance) {
  const bool has_bounds = object.contains("bounds_min") || object.contains("bounds_max");
  if (has_bounds || object.contains("world_from_node")) {
    instance.world_from_node = affine_of_rows(object.at("world_from_node"));
  }
  if (!has_bounds) return;
  instance.bounds_node = {vector_of_json(object.at("bounds_min")),
                          vector_of_json(object.at("bounds_max"))};
}

void require_rigid(const Affine& map, const std::string& name) {
  const bool ends_right =
      (map.matrix().row(3) - Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)).cwiseAbs().maxCoeff() <= 1e-6;
  const bool turns = (map.linear().transpose() * map.linear() - Mat3::Identity()).isZero(2e-3) &&
                     map.linear().determinant() > 0.0;
  if (!ends_right || !turns || !map.matrix().allFinite()) {
    throw std::runtime_error(name + " is no rotation with a shift");
  }
}

void require_usable(const Camera& camera) {
  const bool is_usable = std::isfinite(camera.fx) && std::isfinite(camera.fy) && camera.fx > 0.0 &&
                         camera.fy > 0.0 && std::isfinite(camera.cx) && std::isfinite(camera.cy);
  if (!is_usable) throw std::runtime_error("its focal lengths are not positive numbers");
}

}  // namespace diorama
