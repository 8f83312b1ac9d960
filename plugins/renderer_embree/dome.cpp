// SPDX-License-Identifier: Apache-2.0
#include "dome.h"

#include <algorithm>
#include <cmath>

#include "sampling.h"

namespace diorama {
namespace {

constexpr float kMinSine = 1e-4f;  // keeps densities finite at the poles

/// (0, 0) is the top left of the image.
Vec2f square_from_direction(const Vec3f& d) {
  const float u = 0.5f - std::atan2(d.y(), d.x()) / (2.0f * kPiF);
  const float v = std::acos(std::clamp(d.z(), -1.0f, 1.0f)) / kPiF;
  return {std::clamp(u, 0.0f, 1.0f), std::clamp(v, 0.0f, 1.0f)};
}

float sine_of_row(float v) { return std::max(kMinSine, std::sin(v * kPiF)); }

int cell_of(float x, int count) { return std::clamp(int(x * float(count)), 0, count - 1); }

/// Index of the interval of a cumulative table that holds u.
int interval(const float* cumulative, int count, float u) {
  const float* end = cumulative + count;
  const float* it = std::upper_bound(cumulative + 1, end, u);
  return int(it - cumulative) - 1;
}

}  // namespace

SquareDistribution::SquareDistribution(const std::vector<float>& weights, int width, int height)
    : width_(width), height_(height), weights_(weights) {
  double sum = 0.0;
  for (float w : weights_) sum += double(w);
  const double mean = sum / double(weights_.size());
  if (!(mean > 0.0) || !std::isfinite(mean)) {
    std::fill(weights_.begin(), weights_.end(), 1.0f);
  } else {
    for (float& w : weights_) w = float(double(w) / mean);
  }
  row_sums_.assign(1, 0.0f);
  double total = 0.0;
  for (int y = 0; y < height_; ++y) {
    const float* row = &weights_[std::size_t(y) * std::size_t(width_)];
    double row_sum = 0.0;
    for (int x = 0; x < width_; ++x) row_sum += double(row[x]);
    double running = 0.0;
    within_row_.push_back(0.0f);
    for (int x = 0; x < width_; ++x) {
      running += row_sum > 0.0 ? double(row[x]) / row_sum : 1.0 / width_;
      within_row_.push_back(float(running));
    }
    within_row_.back() = 1.0f;
    total += row_sum;
    row_sums_.push_back(float(total / (double(width_) * double(height_))));
  }
  row_sums_.back() = 1.0f;
}

SquareDistribution::Draw SquareDistribution::sample(const Vec2f& u) const {
  const auto place = [](const float* cumulative, int cell, float value) {
    const float size = cumulative[cell + 1] - cumulative[cell];
    const float rest = size > 0.0f ? (value - cumulative[cell]) / size : 0.5f;
    return float(cell) + std::clamp(rest, 0.0f, 0.99999f);
  };
  const int y = interval(row_sums_.data(), height_, u.y());
  const float* row = &within_row_[std::size_t(y) * std::size_t(width_ + 1)];
  const int x = interval(row, width_, u.x());
  return {
      {place(row, x, u.x()) / float(width_), place(row_sums_.data(), y, u.y()) / float(height_)},
      weights_[std::size_t(y) * std::size_t(width_) + std::size_t(x)]};
}

float SquareDistribution::density(const Vec2f& point) const {
  const int x = cell_of(point.x(), width_);
  const int y = cell_of(point.y(), height_);
  return weights_[std::size_t(y) * std::size_t(width_) + std::size_t(x)];
}

DomeTexture::DomeTexture(std::shared_ptr<const Texture> source) : image_(std::move(source)) {
  // A grid of cells over the image, whole cells per patch, no finer than 1024 x 512.
  const int per_patch_x = std::clamp(image_.width() / kColumns, 2, 64);
  const int per_patch_y = std::clamp(image_.height() / kRows, 2, 64);
  const int width = per_patch_x * kColumns;
  const int height = per_patch_y * kRows;
  const float footprint = 1.0f / float(width);
  std::vector<float> lightness;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Vec2f uv((float(x) + 0.5f) / float(width), 1.0f - (float(y) + 0.5f) / float(height));
      const Rgba texel = image_.lookup(uv, footprint, Wrap::Repeat, Wrap::Clamp);
      lightness.push_back(luminance(texel.head<3>().matrix().cwiseMax(0.0f)));
    }
  }
  // Lookups are bilinear, so a cell also shines with a part of its neighbours.
  const auto blurred = [&](int x, int y) {
    float sum = 0.0f;
    for (int dy = -1; dy <= 1; ++dy) {
      const int row = std::clamp(y + dy, 0, height - 1);
      for (int dx = -1; dx <= 1; ++dx) {
        const int column = (x + dx + width) % width;
        const float share = (dx == 0 ? 0.5f : 0.25f) * (dy == 0 ? 0.5f : 0.25f);
        sum += share * lightness[std::size_t(row) * std::size_t(width) + std::size_t(column)];
      }
    }
    return sum * std::sin((float(y) + 0.5f) / float(height) * kPiF);
  };
  const float cell = 2.0f * kPiF * kPiF / float(width * height);
  for (int patch = 0; patch < kPatches; ++patch) {
    const int x_begin = patch % kColumns * per_patch_x;
    const int y_begin = patch / kColumns * per_patch_y;
    std::vector<float> weights;
    float power = 0.0f;
    for (int y = y_begin; y < y_begin + per_patch_y; ++y) {
      for (int x = x_begin; x < x_begin + per_patch_x; ++x) {
        weights.push_back(blurred(x, y));
        power += weights.back() * cell;
      }
    }
    patches_.emplace_back(weights, per_patch_x, per_patch_y);
    patch_power_.push_back(power);
  }
}

Vec3f DomeTexture::radiance(const Vec3f& direction) const {
  const Vec2f p = square_from_direction(direction);
  const Rgba value = image_.lookup({p.x(), 1.0f - p.y()}, 0.0f, Wrap::Repeat, Wrap::Clamp);
  return value.head<3>().matrix().cwiseMax(0.0f);
}

DomeTexture::Draw DomeTexture::sample(int patch, const Vec2f& u) const {
  const SquareDistribution::Draw draw = patches_[std::size_t(patch)].sample(u);
  const Vec2f p((float(patch % kColumns) + draw.point.x()) / float(kColumns),
                (float(patch / kColumns) + draw.point.y()) / float(kRows));
  const float theta = p.y() * kPiF;
  const float phi = (0.5f - p.x()) * 2.0f * kPiF;
  const float sine = std::sin(theta);
  const Rgba value = image_.lookup({p.x(), 1.0f - p.y()}, 0.0f, Wrap::Repeat, Wrap::Clamp);
  return {{sine * std::cos(phi), sine * std::sin(phi), std::cos(theta)},
          value.head<3>().matrix().cwiseMax(0.0f),
          draw.density * float(kPatches) / (2.0f * kPiF * kPiF * sine_of_row(p.y()))};
}

DomeTexture::Place DomeTexture::place(const Vec3f& direction) const {
  const Vec2f p = square_from_direction(direction);
  const int column = cell_of(p.x(), kColumns);
  const int row = cell_of(p.y(), kRows);
  const int patch = row * kColumns + column;
  const Vec2f within(p.x() * float(kColumns) - float(column), p.y() * float(kRows) - float(row));
  return {patch, patches_[std::size_t(patch)].density(within) * float(kPatches) /
                     (2.0f * kPiF * kPiF * sine_of_row(p.y()))};
}

}  // namespace diorama
