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

/// What depends only on a dome's texture: kept between captures. The sky is cut into patches (equal
/// rectangles of the image), so that light samples can be kept to those that a place can see.
class DomeTexture {
 public:
  static constexpr int kColumns = 16;
  static constexpr int kRows = 8;
  static constexpr int kPatches = kColumns * kRows;

  explicit DomeTexture(std::shared_ptr<const Texture> source);

  /// In the dome's space, unit direction.
  Vec3f radiance(const Vec3f& direction) const;
  /// Luminance times solid angle of a patch.
  float patch_power(int patch) const { return patch_power_[std::size_t(patch)]; }

  struct Draw {
    Vec3f direction;
    Vec3f radiance;
    float density = 0.0f;  ///< Per solid angle, given the patch.
  };
  Draw sample(int patch, const Vec2f& u) const;

  struct Place {
    int patch = 0;
    float density = 0.0f;  ///< As in Draw.
  };
  Place place(const Vec3f& direction) const;

 private:
  MipTexture image_;
  std::vector<SquareDistribution> patches_;
  std::vector<float> patch_power_;
};

}  // namespace diorama
