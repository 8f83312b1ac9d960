// SPDX-License-Identifier: Apache-2.0
#include "ray_blocks.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

constexpr int kBlockSize = 16;
// A block is sampled at its corners, the middles of its edges and its own: rays in between lie
// hardly further out.
constexpr int kSamples = 3;
constexpr double kMargin = 1.25;

double angle_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

RayBlocks::RayBlocks(const Camera& camera, Host& host)
    : all_{-camera.width, -camera.height, 2 * camera.width, 2 * camera.height},
      columns_((all_.width() + kBlockSize - 1) / kBlockSize) {
  const int rows = (all_.height() + kBlockSize - 1) / kBlockSize;
  cones_.resize(std::size_t(columns_) * std::size_t(rows));
  std::vector<char> is_whole(cones_.size(), 0);
  host.parallel_for(std::size_t(rows), [&](std::size_t row) {
    for (std::size_t i = row * std::size_t(columns_); i < (row + 1) * std::size_t(columns_); ++i) {
      bool whole = false;
      cones_[i] = cone_of(camera, block(i), whole);
      is_whole[i] = whole ? 1 : 0;
    }
  });
  // At the rim of what the lens images only some samples have rays, and their cone says too little.
  double widest = 0.0;
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    if (is_whole[i]) widest = std::max(widest, cones_[i].angle);
  }
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    if (!is_whole[i]) cones_[i].angle = std::max(cones_[i].angle, 2.0 * widest);
  }
}

PixelBox RayBlocks::block(std::size_t index) const {
  const int x = all_.x_min + int(index % std::size_t(columns_)) * kBlockSize;
  const int y = all_.y_min + int(index / std::size_t(columns_)) * kBlockSize;
  return {x, y, std::min(x + kBlockSize, all_.x_max), std::min(y + kBlockSize, all_.y_max)};
}

RayBlocks::Cone RayBlocks::cone_of(const Camera& camera, const PixelBox& block,
                                   bool& is_whole) const {
  std::vector<Vec3> rays;
  Vec3 sum = Vec3::Zero();
  for (int row = 0; row < kSamples; ++row) {
    for (int column = 0; column < kSamples; ++column) {
      const Vec2 share(double(column) / (kSamples - 1), double(row) / (kSamples - 1));
      const Vec2 pixel(block.x_min + share.x() * block.width(),
                       block.y_min + share.y() * block.height());
      const auto ray = ray_direction(camera, pixel);
      if (!ray) continue;
      rays.push_back(*ray);
      sum += *ray;
    }
  }
  is_whole = rays.size() == kSamples * kSamples;
  Cone cone;
  if (rays.empty() || sum.norm() == 0.0) return cone;
  cone.axis = sum.normalized();
  for (const Vec3& ray : rays) {
    cone.angle = std::max(cone.angle, kMargin * angle_between(cone.axis, ray));
  }
  return cone;
}

PixelBox RayBlocks::box_of(const Vec3& centre, double radius) const {
  const double distance = centre.norm();
  if (!(distance > radius)) return all_;
  const Vec3 towards = centre / distance;
  const double sphere_angle = std::asin(radius / distance);
  PixelBox box{all_.x_max, all_.y_max, all_.x_min, all_.y_min};
  for (std::size_t i = 0; i < cones_.size(); ++i) {
    const Cone& cone = cones_[i];
    if (cone.axis.isZero()) continue;
    const double reach = cone.angle + sphere_angle;
    if (reach < kPi && towards.dot(cone.axis) < std::cos(reach)) continue;
    const PixelBox own = block(i);
    box = {std::min(box.x_min, own.x_min), std::min(box.y_min, own.y_min),
           std::max(box.x_max, own.x_max), std::max(box.y_max, own.y_max)};
  }
  return box;
}

}  // namespace diorama
