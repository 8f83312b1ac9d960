// SPDX-License-Identifier: Apache-2.0
#include "dome.h"

#include <algorithm>
#include <cmath>

namespace diorama {
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

namespace {

/// The table merged into cells twice as large as long as that costs little: large tables do not fit
/// into the processor's caches, and most of a sky is smooth.
SquareDistribution smallest_table(std::vector<float> weights, int width, int height) {
  constexpr float kMaxLoss = 1.1f;  // growth of the weights' second moment
  double fine = 0.0;
  for (const float w : weights) fine += double(w) * double(w);
  fine /= double(weights.size());
  while (width % 2 == 0 && height % 2 == 0) {
    std::vector<float> merged;
    double second = 0.0;
    for (int y = 0; y < height; y += 2) {
      for (int x = 0; x < width; x += 2) {
        const float* p = &weights[std::size_t(y * width + x)];
        const float* q = p + width;
        merged.push_back(0.25f * (p[0] + p[1] + q[0] + q[1]));
        second += double(merged.back()) * double(merged.back());
      }
    }
    if (fine > kMaxLoss * second / double(merged.size())) break;
    weights = std::move(merged);
    width /= 2;
    height /= 2;
  }
  return SquareDistribution(weights, width, height);
}

}  // namespace

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
    patches_.push_back(smallest_table(std::move(weights), per_patch_x, per_patch_y));
    patch_power_.push_back(power);
  }
}

}  // namespace diorama
