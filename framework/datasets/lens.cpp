// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/lens.h"

#include <cmath>

namespace diorama::lint {
namespace {

/// OpenCV's rational model on normalised coordinates.
Vec2 distorted(const std::array<double, 8>& k, const Vec2& p) {
  const double r2 = p.squaredNorm();
  const double above = 1.0 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
  const double below = 1.0 + k[5] * r2 + k[6] * r2 * r2 + k[7] * r2 * r2 * r2;
  const double xy = p.x() * p.y();
  return Vec2(p * (above / below)) + Vec2(2.0 * k[2] * xy + k[3] * (r2 + 2.0 * p.x() * p.x()),
                                          k[2] * (r2 + 2.0 * p.y() * p.y()) + 2.0 * k[3] * xy);
}

double angle_at(const std::array<double, 6>& k, double radius) {
  double angle = 0.0;
  double power = 1.0;
  for (const double factor : k) {
    angle += factor * power;
    power *= radius;
  }
  return angle;
}

}  // namespace

Lens lens_of(const Camera& camera) {
  Lens lens;
  if (camera.lens == LensModel::OpencvPinhole) lens.model = Lens::Model::Opencv;
  if (camera.lens == LensModel::FisheyePolynomial) lens.model = Lens::Model::Fisheye;
  lens.width = camera.width;
  lens.height = camera.height;
  lens.focal = {camera.fx, camera.fy};
  lens.centre = {camera.cx, camera.cy};
  lens.distortion = camera.distortion;
  lens.polynomial = camera.fisheye_polynomial;
  lens.max_angle = camera.fisheye_max_angle_rad;
  return lens;
}

std::optional<Vec2> Lens::pixel(const Vec3& p) const {
  if (model == Model::Fisheye) {
    const double flat = p.head<2>().norm();
    const double angle = std::atan2(flat, p.z());
    if (angle > max_angle) return std::nullopt;
    if (flat == 0.0) return centre;
    double inner = 0.0;
    double outer = 4.0 * (width + height);
    for (int i = 0; i < 80; ++i) {
      const double middle = 0.5 * (inner + outer);
      (angle_at(polynomial, middle) < angle ? inner : outer) = middle;
    }
    return Vec2(centre + inner / flat * p.head<2>());
  }
  if (p.z() <= 1e-9) return std::nullopt;
  Vec2 flat = p.head<2>() / p.z();
  if (model == Model::Opencv) flat = distorted(distortion, flat);
  return Vec2(focal.cwiseProduct(flat) + centre);
}

std::optional<Vec3> Lens::direction(const Vec2& pixel) const {
  const Vec2 offset = pixel - centre;
  if (model == Model::Fisheye) {
    const double radius = offset.norm();
    const double angle = angle_at(polynomial, radius);
    if (angle > max_angle) return std::nullopt;
    const Vec2 side = radius > 0.0 ? Vec2(offset / radius) : Vec2(Vec2::Zero());
    return Vec3(std::sin(angle) * side.x(), std::sin(angle) * side.y(), std::cos(angle));
  }
  const Vec2 wanted = offset.cwiseQuotient(focal);
  Vec2 flat = wanted;
  if (model == Model::Opencv) {
    for (int i = 0; i < 60; ++i) flat += 0.8 * (wanted - distorted(distortion, flat));
    if (!((distorted(distortion, flat) - wanted).norm() < 1e-6)) return std::nullopt;
  }
  return Vec3(flat.x(), flat.y(), 1.0);
}

}  // namespace diorama::lint
