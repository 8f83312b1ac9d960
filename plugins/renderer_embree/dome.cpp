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

/// One line with every value mixed half and half with the mean of its neighbours.
template <class Neighbour>
void blur(float* line, int count, int step, Neighbour&& neighbour) {
  std::vector<float> before(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) before[std::size_t(i)] = line[i * step];
  for (int i = 0; i < count; ++i) {
    const float sides =
        before[std::size_t(neighbour(i - 1))] + before[std::size_t(neighbour(i + 1))];
    line[i * step] = 0.5f * before[std::size_t(i)] + 0.25f * sides;
  }
}

/// Luminance over a grid of cells on the image.
std::vector<float> lightness(const MipTexture& image, int width, int height) {
  // Images whose size halves to the grid's have it ready.
  int level = 0;
  while (level + 1 < image.level_count() && image.width() >> level > width) ++level;
  const bool is_ready = image.width() >> level == width && image.height() >> level == height;
  const float footprint = 1.0f / float(width);
  std::vector<float> values;
  values.reserve(std::size_t(width * height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Vec2f uv((float(x) + 0.5f) / float(width), 1.0f - (float(y) + 0.5f) / float(height));
      const Rgba texel = is_ready ? image.texel(level, x, y)
                                  : image.lookup(uv, footprint, Wrap::Repeat, Wrap::Clamp);
      values.push_back(luminance(texel.head<3>().matrix().cwiseMax(0.0f)));
    }
  }
  return values;
}

}  // namespace

DomeTexture::DomeTexture(std::shared_ptr<const Texture> source) : image_(std::move(source)) {
  // A grid of cells over the image, whole cells per patch, no finer than 1024 x 512.
  const int per_patch_x = std::clamp(image_.width() / kColumns, 2, 64);
  const int per_patch_y = std::clamp(image_.height() / kRows, 2, 64);
  const int width = per_patch_x * kColumns;
  const int height = per_patch_y * kRows;
  std::vector<float> cells = lightness(image_, width, height);
  // Lookups are bilinear, so a cell also shines with a part of its neighbours.
  for (int y = 0; y < height; ++y) {
    blur(&cells[std::size_t(y * width)], width, 1, [&](int x) { return (x + width) % width; });
  }
  for (int x = 0; x < width; ++x) {
    blur(&cells[std::size_t(x)], height, width,
         [&](int y) { return std::clamp(y, 0, height - 1); });
  }
  for (int y = 0; y < height; ++y) {
    const float sine = std::sin((float(y) + 0.5f) / float(height) * kPiF);
    for (int x = 0; x < width; ++x) cells[std::size_t(y * width + x)] *= sine;
  }
  const float cell = 2.0f * kPiF * kPiF / float(width * height);
  for (int patch = 0; patch < kPatches; ++patch) {
    const int x_begin = patch % kColumns * per_patch_x;
    const int y_begin = patch / kColumns * per_patch_y;
    std::vector<float> weights;
    float power = 0.0f;
    for (int y = y_begin; y < y_begin + per_patch_y; ++y) {
      for (int x = x_begin; x < x_begin + per_patch_x; ++x) {
        weights.push_back(cells[std::size_t(y * width + x)]);
        power += weights.back() * cell;
      }
    }
    patches_.push_back(smallest_table(std::move(weights), per_patch_x, per_patch_y));
    patch_power_.push_back(power);
  }
}

}  // namespace diorama
