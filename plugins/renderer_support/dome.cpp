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

constexpr int kMostPerPatch = 64;  // cells along each side

/// The table merged into cells twice as large as long as that costs little: large tables do not fit
/// into the processor's caches, and most of a sky is smooth.
SquareDistribution smallest_table(std::vector<float> weights, int width, int height) {
  constexpr float kMaxLoss = 1.1f;  // growth of the weights' second moment
  double fine = 0.0;
  for (const float w : weights) fine += double(w) * double(w);
  fine /= double(weights.size());
  while (width % 2 == 0 && height % 2 == 0) {
    std::vector<float> merged;
    merged.reserve(weights.size() / 4);
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

/// Every cell mixed half and half with the mean of those beside it, which close to a ring, and then
/// with the mean of those above and below.
std::vector<float> blurred(std::vector<float> cells, int width, int height) {
  const auto mix = [](float a, float b, float c) { return 0.5f * b + 0.25f * (a + c); };
  std::vector<float> across(cells.size());
  for (int y = 0; y < height; ++y) {
    const float* from = &cells[std::size_t(y * width)];
    float* to = &across[std::size_t(y * width)];
    to[0] = mix(from[width - 1], from[0], from[1]);
    for (int x = 1; x + 1 < width; ++x) to[x] = mix(from[x - 1], from[x], from[x + 1]);
    to[width - 1] = mix(from[width - 2], from[width - 1], from[0]);
  }
  for (int y = 0; y < height; ++y) {
    const float* from = &across[std::size_t(y * width)];
    const float* above = y > 0 ? from - width : from;
    const float* below = y + 1 < height ? from + width : from;
    float* to = &cells[std::size_t(y * width)];
    for (int x = 0; x < width; ++x) to[x] = mix(above[x], from[x], below[x]);
  }
  return cells;
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

// Smaller versions serve lightness() alone.
DomeTexture::DomeTexture(const Texture& source) : image_(source, kColumns * kMostPerPatch) {
  // A grid of cells over the image, whole cells per patch.
  const int per_patch_x = std::clamp(image_.width() / kColumns, 2, kMostPerPatch);
  const int per_patch_y = std::clamp(image_.height() / kRows, 2, kMostPerPatch);
  const int width = per_patch_x * kColumns;
  const int height = per_patch_y * kRows;
  // Lookups are bilinear, so a cell also shines with a part of its neighbours.
  std::vector<float> cells = blurred(lightness(image_, width, height), width, height);
  for (int y = 0; y < height; ++y) {
    const float sine = std::sin((float(y) + 0.5f) / float(height) * kPiF);
    float* row = &cells[std::size_t(y * width)];
    for (int x = 0; x < width; ++x) row[x] *= sine;
  }
  const float cell = 2.0f * kPiF * kPiF / float(width * height);
  for (int patch = 0; patch < kPatches; ++patch) {
    const int x_begin = patch % kColumns * per_patch_x;
    const int y_begin = patch / kColumns * per_patch_y;
    std::vector<float> weights;
    weights.reserve(std::size_t(per_patch_x * per_patch_y));
    for (int y = y_begin; y < y_begin + per_patch_y; ++y) {
      const float* row = &cells[std::size_t(y * width + x_begin)];
      weights.insert(weights.end(), row, row + per_patch_x);
    }
    float power = 0.0f;
    for (const float weight : weights) power += weight * cell;
    patches_.push_back(smallest_table(std::move(weights), per_patch_x, per_patch_y));
    patch_power_.push_back(power);
    mean_luminance_ += power / (4.0f * kPiF);
  }
  // Cells are larger than it.
  constexpr float kInCell = 0.25f;
  has_sun_ = *std::max_element(cells.begin(), cells.end()) > kInCell * kSun * mean_luminance_;
}

std::shared_ptr<DomeCache> DomeCache::shared() {
  static std::mutex mutex;
  static std::weak_ptr<DomeCache> known;
  const std::lock_guard lock(mutex);
  std::shared_ptr<DomeCache> cache = known.lock();
  if (!cache) known = cache = std::make_shared<DomeCache>();
  return cache;
}

std::shared_ptr<const DomeTexture> DomeCache::dome_of(const std::shared_ptr<const Texture>& image) {
  std::shared_ptr<Entry> entry;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<Entry>& known = entries_[image.get()];
    if (!known || known->image.lock() != image) {
      known = std::make_shared<Entry>();
      known->image = image;
    }
    entry = known;
  }
  std::call_once(entry->is_made,
                 [&] { entry->dome = std::make_shared<const DomeTexture>(*image); });
  return entry->dome;
}

void DomeCache::forget_dead_images() {
  const std::lock_guard lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) { return entry.second->image.expired(); });
}

std::size_t DomeCache::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace diorama
