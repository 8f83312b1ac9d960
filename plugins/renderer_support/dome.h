// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "diorama/light.h"
#include "mip_texture.h"
#include "sampling.h"

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
  /// A point in two steps: its row first, which may be fetched before the second reads it.
  float row(float u) const { return inverse(row_sums_.data(), height_, u); }
  void prefetch_row(float row) const;
  Draw sample_row(float row, float u) const;
  float density(const Vec2f& point) const {
    const int x = cell_of(point.x(), width_);
    const int y = cell_of(point.y(), height_);
    return weights_[std::size_t(y) * std::size_t(width_) + std::size_t(x)];
  }
  int width() const { return width_; }
  int height() const { return height_; }
  const std::vector<float>& weights() const { return weights_; }
  const std::vector<float>& row_sums() const { return row_sums_; }
  const std::vector<float>& within_row() const { return within_row_; }
  static int cell_of(float x, int count) { return std::clamp(int(x * float(count)), 0, count - 1); }

 private:
  /// Place of u among the intervals of a cumulative table, as index plus share.
  static float inverse(const float* cumulative, int count, float u) {
    const int i = interval_of(cumulative, count, u);
    const float size = cumulative[i + 1] - cumulative[i];
    const float rest = size > 0.0f ? (u - cumulative[i]) / size : 0.5f;
    return float(i) + std::clamp(rest, 0.0f, 0.99999f);
  }

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

  /// The source must outlive all lookups; see MipTexture.
  explicit DomeTexture(const Texture& source);

  const MipTexture& image() const { return image_; }
  const std::vector<SquareDistribution>& patches() const { return patches_; }
  /// Luminance times solid angle of a patch.
  float patch_power(int patch) const { return patch_power_[std::size_t(patch)]; }
  /// Whether a small part of it is far brighter than the whole, ...
  bool has_sun() const { return has_sun_; }
  /// ... and whether it is there.
  bool is_sun(const Vec2f& place) const {
    return luminance(radiance_at(place)) > kSun * mean_luminance_;
  }

  struct Draw {
    Vec2f place;           ///< In the image.
    float density = 0.0f;  ///< Over the patch's square.
  };
  Draw sample(int patch, const Vec2f& u) const {
    return sample_row(patch, patches_[std::size_t(patch)].row(u.y()), u.x());
  }
  /// The second step of that; see SquareDistribution.
  Draw sample_row(int patch, float row, float u) const;

  struct Towards {
    Vec3f direction;
    float per_solid_angle = 0.0f;  ///< Factor of a density over a patch's square.
  };
  /// A place of the image, seen from inside.
  static Towards towards(const Vec2f& place);

  struct Place {
    int patch = 0;
    float density = 0.0f;  ///< Per solid angle, given the patch.
    Vec3f radiance = Vec3f::Zero();
  };
  Place place(const Vec3f& direction) const;

  /// Starts to fetch what radiance_at() will read.
  void prefetch(const Vec2f& place) const { image_.prefetch({place.x(), 1.0f - place.y()}); }
  /// (0, 0) is the top left of the image.
  Vec3f radiance_at(const Vec2f& p) const {
    const Rgba value = image_.lookup({p.x(), 1.0f - p.y()}, 0.0f, Wrap::Repeat, Wrap::Clamp);
    return value.head<3>().matrix().cwiseMax(0.0f);
  }

 private:
  /// Of its mean; clouds beside the sun have some 30 times as much.
  static constexpr float kSun = 300.0f;
  /// See Towards; finite at the poles.
  static float per_solid_angle(float sine) {
    return float(kPatches) / (2.0f * kPiF * kPiF * std::max(1e-4f, sine));
  }

  MipTexture image_;
  std::vector<SquareDistribution> patches_;
  std::vector<float> patch_power_;
  float mean_luminance_ = 0.0f;
  bool has_sun_ = false;
};

/// Domes of images, for all renderers of the process: visits that go on side by side show the same
/// skies. A dome stays as long as anybody else, a scene or a cache of assets, keeps its image. From
/// any thread.
class DomeCache {
 public:
  /// The library's only one, which lives as long as somebody holds it.
  static std::shared_ptr<DomeCache> shared();

  std::shared_ptr<const DomeTexture> dome_of(const std::shared_ptr<const Texture>& image);
  void forget_dead_images();
  std::size_t size() const;

 private:
  struct Entry {
    std::weak_ptr<const Texture> image;
    std::once_flag is_made;  ///< Others wait for the one who makes it.
    std::shared_ptr<const DomeTexture> dome;
  };
  mutable std::mutex mutex_;
  std::map<const Texture*, std::shared_ptr<Entry>> entries_;
};

inline void SquareDistribution::prefetch_row(float y) const {
  constexpr int kFloatsPerLine = 16;
  const float* row = &within_row_[std::size_t(y) * std::size_t(width_ + 1)];
  for (int x = 0; x < width_; x += kFloatsPerLine) __builtin_prefetch(row + x);
  __builtin_prefetch(row + width_);
}

inline SquareDistribution::Draw SquareDistribution::sample_row(float y, float u) const {
  const auto row = std::size_t(y);
  const float x = inverse(&within_row_[row * std::size_t(width_ + 1)], width_, u);
  return {{x / float(width_), y / float(height_)},
          weights_[row * std::size_t(width_) + std::size_t(x)]};
}

inline DomeTexture::Draw DomeTexture::sample_row(int patch, float row, float u) const {
  const SquareDistribution::Draw draw = patches_[std::size_t(patch)].sample_row(row, u);
  return {{(float(patch % kColumns) + draw.point.x()) / float(kColumns),
           (float(patch / kColumns) + draw.point.y()) / float(kRows)},
          draw.density};
}

inline DomeTexture::Towards DomeTexture::towards(const Vec2f& place) {
  const CosSin height = unit_circle(0.5f * place.y());
  const CosSin around = unit_circle(place.x());
  const float sine = height.sine;
  // The image's centre column lies at +x, its right half towards -y.
  return {{-sine * around.cosine, sine * around.sine, height.cosine}, per_solid_angle(sine)};
}

inline DomeTexture::Place DomeTexture::place(const Vec3f& d) const {
  const float u = 0.5f - std::atan2(d.y(), d.x()) / (2.0f * kPiF);
  const float v = std::acos(std::clamp(d.z(), -1.0f, 1.0f)) / kPiF;
  const Vec2f p(std::clamp(u, 0.0f, 1.0f), std::clamp(v, 0.0f, 1.0f));
  const int column = SquareDistribution::cell_of(p.x(), kColumns);
  const int row = SquareDistribution::cell_of(p.y(), kRows);
  const int patch = row * kColumns + column;
  const Vec2f within(p.x() * float(kColumns) - float(column), p.y() * float(kRows) - float(row));
  const float sine = std::sqrt(std::max(0.0f, 1.0f - d.z() * d.z()));
  return {patch, patches_[std::size_t(patch)].density(within) * per_solid_angle(sine),
          radiance_at(p)};
}

}  // namespace diorama
