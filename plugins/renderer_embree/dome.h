// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "diorama/light.h"
#include "mip_texture.h"

namespace diorama {

/// Draws from a table of non-negative weights over the unit square, constant within each cell.
/// Where all weights are zero it is uniform.
class SquareDistribution {
 public:
  SquareDistribution() = default;
  /// `weights` row by row, width * height of them.
  SquareDistribution(const std::vector<float>& weights, int width, int height);

  struct Draw {
    Vec2f point;
    float density = 0.0f;
  };
  Draw sample(const Vec2f& u) const;
  float density(const Vec2f& point) const;

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<float> weights_;     ///< Scaled to a mean of 1.
  std::vector<float> row_sums_;    ///< Cumulative, height + 1 of them, last is 1.
  std::vector<float> within_row_;  ///< Cumulative, (width + 1) per row.
};

/// What depends only on a dome's texture: kept between captures.
class DomeTexture {
 public:
  explicit DomeTexture(std::shared_ptr<const Texture> source);

  /// In the dome's space, unit direction.
  Vec3f radiance(const Vec3f& direction) const;
  Vec3f mean_radiance() const { return mean_; }  ///< Over the sphere.

  struct Draw {
    Vec3f direction;
    float density = 0.0f;  ///< Per solid angle.
  };
  Draw sample(const Vec2f& u) const;
  float density(const Vec3f& direction) const;

 private:
  MipTexture image_;
  SquareDistribution distribution_;
  Vec3f mean_ = Vec3f::Zero();
};

}  // namespace diorama
