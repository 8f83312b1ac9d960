// SPDX-License-Identifier: Apache-2.0
#include "network_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "denoiser_network.h"
#include "denoiser_weights.h"
#include "pixel_layers.h"
#include "sampling.h"
#include "wide_math.h"

namespace diorama {
namespace {

using Network = DenoiserNetwork;

// Large pictures fall into tiles that see a little of their neighbours.
constexpr int kTile = 1024;
constexpr int kSeen = 128;  // pixels beside a tile
constexpr int kLargest = kTile + 2 * kSeen;
static_assert(kTile % Network::kAlignment == 0 && kSeen % Network::kAlignment == 0);
/// Held at most while a tile is denoised.
constexpr std::size_t kTileBytesPerPixel = 288;

/// Of the network's features of which the logarithm, ln(1 + x), is taken: what that is multiplied
/// by.
constexpr std::array<float, Network::kFeatures> kLogScales{
    1 / 3.0f, 1 / 3.0f, 1 / 3.0f, 0,        0,
    0,        0,        0,        0,        1 / 2.0f,
    0,        1 / 3.0f, 0,        0,        1.44269504f / 8.0f,
    1 / 3.0f, 1 / 3.0f, 1 / 3.0f, 1 / 3.0f, 1 / 3.0f};

constexpr float kMinAlbedo = 0.02f;
constexpr float kSmallest = 1e-6f;
constexpr float kLargestLogit = 30.0f;    // of shares
constexpr float kLeastExponent = -80.0f;  // of a tap's weight beside the largest
// Of the paths of one pixel: what so many may bring each, one of more may bring for all of them.
constexpr float kLimitedPaths = 16.0f;
// A path may be so many times as bright as the others around it, whatever the limit.
constexpr float kTimesOthers = 4.0f;

constexpr float kMostGain = 1.0f;  // of a level, where it is all noise
constexpr int kCalmLevel = 3;      // whose noise says whether there is any, ...
constexpr float kCalm = 0.002f;    // ... so much of the light or more
constexpr int kReach = 2;          // of the taps among a level's own pixels
constexpr int kSide = 2 * kReach + 1;
constexpr int kMargin = 32;  // pixels beside a row that taps may read

/// Of rows that are gone through in groups of up to 16 numbers.
std::size_t row_stride(std::size_t width) { return (width + 15) / 16 * 16; }

/// Of a level of the pyramid: scattered light and the surfaces' colours, which are averaged, then
/// the light's standard deviation and what that is compared with.
enum Layer { kLight = 0, kColor = 3, kPair = 6, kNoise = 6, kShade = 7, kLayers = 8 };
using Pyramid = PixelLayers<kLayers>;
using Pairs = PixelLayers<kPair>;

/// How much of what a pixel shows is noise, which counts as all where the light, so many times, is
/// far less.
inline float noise_share(const Pyramid::Row& row, int x, float times = 1.0f) {
  const float noise = *row.at(kNoise, x);
  return noise / std::max(noise + times * *row.at(kShade, x), 1e-12f);
}

/// Light beyond this has no sums.
constexpr float kMostLight = 1e15f;

float finite(float value) {
  return std::isfinite(value) ? std::clamp(value, -kMostLight, kMostLight) : 0.0f;
}
Vec3f finite(const Vec3f& value) {
  return value.unaryExpr([](float v) { return finite(v); });
}

/// A film's pixel without numbers that are none, and without negative light.
FilmPixel sound(const FilmPixel& pixel) {
  FilmPixel p;
  p.seen = finite(pixel.seen).cwiseMax(0.0f);
  p.scattered = finite(pixel.scattered).cwiseMax(0.0f);
  p.albedo = finite(pixel.albedo).cwiseMax(0.0f);
  p.normal = finite(pixel.normal);
  p.position = finite(pixel.position);
  p.variance = std::max(0.0f, finite(pixel.variance));
  p.brightest = std::max(0.0f, finite(pixel.brightest));
  p.count = std::max(1.0f, finite(pixel.count));
  p.surface_share = std::clamp(finite(pixel.surface_share), 0.0f, 1.0f);
  return p;
}

struct Believed {
  Vec3f scattered;
  float variance;
};

/// The light of the film's `pixel`, made sound, without what its brightest path brings beyond
/// belief.
Believed believable(const Film& film, const FilmPixel& pixel, int x, int y, float limit) {
  const float times = std::max(1.0f, pixel.count / kLimitedPaths);
  const bool is_limited = limit > 0.0f && pixel.count > 1.5f;
  if (!is_limited || pixel.brightest <= limit * times) return {pixel.scattered, pixel.variance};
  float others = 0.0f;
  float count = 0.0f;
  for (int v = std::max(0, y - 1); v < std::min(film.height(), y + 2); ++v) {
    for (int u = std::max(0, x - 1); u < std::min(film.width(), x + 2); ++u) {
      const FilmPixel near = sound(film.at(u, v));
      others += luminance(near.scattered) * near.count - near.brightest;
      count += near.count - 1.0f;
    }
  }
  const float most = times * (limit + kTimesOthers * std::max(0.0f, others) / count);
  const float own = luminance(pixel.scattered);
  const float removed = std::min(own, (pixel.brightest - most) / pixel.count);
  if (!(removed > 0.0f)) return {pixel.scattered, pixel.variance};
  // As if that path had been as bright as it may be.
  const double n = double(pixel.count);
  const double less = double(own) - double(removed);
  const double squares = double(pixel.variance) * (n - 1.0) + double(own) * double(own) -
                         (std::pow(double(pixel.brightest), 2) - std::pow(double(most), 2)) / n;
  return {pixel.scattered * float(less / double(own)),
          float(std::max(0.0, squares - less * less) / (n - 1.0))};
}

/// The part of a picture that is denoised at once, in its pixels.
struct Tile {
  PixelBox seen;  ///< All that the network sees.
  PixelBox wanted;
};

std::vector<Tile> tiles_of(int width, int height) {
  const auto cuts = [](int size) {
    std::vector<std::pair<int, int>> parts;
    if (size <= kLargest) return std::vector{std::pair{0, size}};
    for (int begin = 0; begin < size; begin += kTile) {
      parts.emplace_back(begin, std::min(size, begin + kTile));
    }
    return parts;
  };
  std::vector<Tile> tiles;
  for (const auto& [y_begin, y_end] : cuts(height)) {
    for (const auto& [x_begin, x_end] : cuts(width)) {
      tiles.push_back({{std::max(0, x_begin - kSeen), std::max(0, y_begin - kSeen),
                        std::min(width, x_end + kSeen), std::min(height, y_end + kSeen)},
                       {x_begin, y_begin, x_end, y_end}});
    }
  }
  return tiles;
}

int aligned(int size) {
  return (size + Network::kAlignment - 1) / Network::kAlignment * Network::kAlignment;
}

/// Denoises one tile.
class TileFilter {
 public:
  /// `image`: what another filter made of the film, and in the end the result.
  TileFilter(const Film& film, Image<Vec3f>& image, const Tile& tile,
             const DenoiseSettings& settings, float exposure, Isa isa, Host& host)
      : film_(film),
        image_(image),
        tile_(tile),
        network_(denoiser_network()),
        settings_(settings),
        exposure_(exposure),
        isa_(isa),
        host_(host),
        own_width_(tile.seen.x_max - tile.seen.x_min),
        own_height_(tile.seen.y_max - tile.seen.y_min),
        width_(aligned(own_width_)),
        height_(aligned(own_height_)) {}

  void run();

 private:
  enum class Step : std::uint8_t { Read, Filter, Finish };

  void read(int block_row);
  void read_pixel(int x, int y, float* features, std::size_t stride);
  void gather_next(std::size_t level);
  void weigh_quads(std::size_t level, int y);
  void all_rows(Step step, std::size_t level, int height);
  template <int kWide>
  void rows(Step step, std::size_t level, int y);
  void rows_sse42(Step step, std::size_t level, int y);
  void rows_avx2(Step step, std::size_t level, int y);
  void rows_avx512(Step step, std::size_t level, int y);
  template <int kWide>
  void filter(std::size_t level, int y);
  float needed(int x, int y) const;
  template <int kWide>
  void finish(int block_row);
  template <int kWide>
  void sum_taps(std::size_t level, int y, const float* weights, std::size_t stride, float* sums);

  const Film& film_;
  Image<Vec3f>& image_;
  const Tile& tile_;
  const Network& network_;
  const DenoiseSettings& settings_;
  float exposure_;
  Isa isa_;
  Host& host_;
  int own_width_;  ///< Of the part of the film.
  int own_height_;
  int width_;  ///< Filled up to what the network takes.
  int height_;
  std::array<Pyramid, Network::kDepth + 1> pairs_;  ///< The first is the picture's.
  std::array<Pairs, Network::kDepth + 1> results_;  ///< Averaged; of the picture none.
  PixelLayers<3> seen_;
  ChannelBlocks features_;
  Network::Logits logits_;
};

void TileFilter::run() {
  pairs_[0] = Pyramid(width_, height_, kMargin);
  seen_ = PixelLayers<3>(own_width_, own_height_, kMargin);
  SpareMemory spare;
  features_ = ChannelBlocks(4 * Network::kFeatures, width_ / 2, height_ / 2, spare);
  all_rows(Step::Read, 0, height_ / 2);
  logits_ = network_.run(std::move(features_), isa_, host_, spare);
  for (std::size_t level = 1; level <= Network::kDepth; ++level) gather_next(level);
  for (std::size_t level = Network::kDepth; level > 0; --level) {
    results_[level] = Pairs(width_ >> level, height_ >> level, kMargin);
    all_rows(Step::Filter, level, height_ >> level);
  }
  all_rows(Step::Finish, 0, (own_height_ + 1) / 2);
}

void TileFilter::all_rows(Step step, std::size_t level, int height) {
  host_.parallel_for(std::size_t(height), [&](std::size_t y) {
    switch (isa_) {
      case Isa::Sse2:
        return rows<4>(step, level, int(y));
      case Isa::Sse42:
        return rows_sse42(step, level, int(y));
      case Isa::Avx2:
        return rows_avx2(step, level, int(y));
      case Isa::Avx512:
        return rows_avx512(step, level, int(y));
    }
  });
}

#define DIORAMA_KERNEL(NAME, ARCH, WIDE)                                                          \
  [[gnu::target("arch=" ARCH), gnu::flatten]] void TileFilter::NAME(Step step, std::size_t level, \
                                                                    int y) {                      \
    rows<WIDE>(step, level, y);                                                                   \
  }
DIORAMA_KERNEL(rows_sse42, "x86-64-v2", 4)
DIORAMA_KERNEL(rows_avx2, "x86-64-v3", 8)
DIORAMA_KERNEL(rows_avx512, "x86-64-v4", 16)
#undef DIORAMA_KERNEL

template <int kWide>
inline void TileFilter::rows(Step step, std::size_t level, int y) {
  switch (step) {
    case Step::Read:
      return read(y);
    case Step::Filter:
      return filter<kWide>(level, y);
    case Step::Finish:
      return finish<kWide>(y);
  }
}

/// Two rows of the film, as blocks of 2 x 2 pixels.
inline void TileFilter::read(int block_row) {
  for (int block = 0; block < features_.blocks(); ++block) {
    std::fill_n(features_.at(block, 0, block_row), features_.width() * ChannelBlocks::kWidth, 0.0f);
  }
  const auto width = std::size_t(own_width_);
  std::vector<float> values(Network::kFeatures * width);
  for (int y = 2 * block_row; y < 2 * block_row + 2; ++y) {
    pairs_[0].fill_margins(y, {});
    const auto row = pairs_[0].row(y);
    for (int layer = 0; layer < kLayers; ++layer) std::fill_n(row.at(layer, 0), width_, 0.0f);
    if (y >= own_height_) continue;
    seen_.fill_margins(y, {});
    for (int x = 0; x < own_width_; ++x) read_pixel(x, y, values.data() + x, width);
    for (std::size_t f = 0; f < Network::kFeatures; ++f) {
      float* const from = values.data() + f * width;
      const float scale = kLogScales[f];
      if (scale > 0.0f) {
        for (std::size_t x = 0; x < width; ++x) {
          from[x] = scale * fast_log1p(std::min(from[x], 1e30f));
        }
      }
      for (std::size_t x = 0; x < width; ++x) {
        float* const block = features_.at(int(f) / 4, int(x / 2), block_row);
        block[4 * (f % 4) + 2 * std::size_t(y % 2) + x % 2] = from[x];
      }
    }
  }
}

/// What the network is told of a pixel, `stride` apart; logarithms are to be taken as yet.
inline void TileFilter::read_pixel(int x, int y, float* features, std::size_t stride) {
  const int film_x = tile_.seen.x_min + x;
  const int film_y = tile_.seen.y_min + y;
  const FilmPixel pixel = sound(film_.at(film_x, film_y));
  const Believed believed = believable(film_, pixel, film_x, film_y, settings_.brightest_path);
  const bool is_surface = pixel.surface_share > 0.0f;
  const Vec3f albedo = pixel.albedo.cwiseMax(kMinAlbedo * pixel.surface_share);
  const auto row = pairs_[0].row(y);
  const auto seen_row = seen_.row(y);
  for (int k = 0; k < 3; ++k) {
    *row.at(kLight + k, x) = believed.scattered[k];
    *row.at(kColor + k, x) = albedo[k];
    *seen_row.at(k, x) = pixel.seen[k];
  }
  const Vec3f irradiance = believed.scattered.cwiseQuotient(albedo.cwiseMax(kSmallest));
  const float distance = is_surface ? (pixel.position - settings_.view_position).norm() : 0.0f;
  const float own = luminance(pixel.scattered);
  const float shade = luminance(believed.scattered) * exposure_;
  const float noise = finite(std::sqrt(believed.variance) * exposure_);
  const float compared = finite(shade + 0.02f);
  *row.at(kNoise, x) = pixel.count > 1.5f ? noise : compared;  // of a single path nobody knows
  *row.at(kShade, x) = compared;
  const float peak = pixel.brightest / std::max(pixel.count * own, 1e-12f);
  const float scale = 8.0f * exposure_;
  const Vec3f other = (finite(image_.at(film_x, film_y)) - pixel.seen).cwiseMax(0.0f);
  const Vec3f other_irradiance = other.cwiseQuotient(albedo.cwiseMax(kSmallest));
  const std::array<float, Network::kFeatures> values{scale * irradiance.x(),
                                                     scale * irradiance.y(),
                                                     scale * irradiance.z(),
                                                     pixel.albedo.x(),
                                                     pixel.albedo.y(),
                                                     pixel.albedo.z(),
                                                     pixel.normal.x(),
                                                     pixel.normal.y(),
                                                     pixel.normal.z(),
                                                     distance,
                                                     noise / (noise + compared),
                                                     scale * luminance(pixel.seen),
                                                     pixel.surface_share,
                                                     std::min(peak, 1.0f),
                                                     pixel.count - 1.0f,
                                                     8.0f * shade,
                                                     scale * other_irradiance.x(),
                                                     scale * other_irradiance.y(),
                                                     scale * other_irradiance.z(),
                                                     scale * luminance(other)};
  for (std::size_t f = 0; f < Network::kFeatures; ++f) features[f * stride] = values[f];
}

/// The level's pixels from blocks of 2 x 2 of the one before, as the network weighs them.
void TileFilter::gather_next(std::size_t level) {
  const int width = width_ >> level;
  const int height = height_ >> level;
  pairs_[level] = Pyramid(width, height, kMargin);
  host_.parallel_for(std::size_t(height), [&](std::size_t y) { weigh_quads(level, int(y)); });
}

void TileFilter::weigh_quads(std::size_t level, int y) {
  const int width = width_ >> level;
  pairs_[level].fill_margins(y, {});
  const auto out = pairs_[level].row(y);
  const ChannelBlocks& logits = logits_.levels[level >= 2 ? level - 2 : 0];
  const auto logit = [&](int x, int channel, int row) {
    return logits.at(channel / ChannelBlocks::kWidth, x, row)[channel % ChannelBlocks::kWidth];
  };
  for (int x = 0; x < width; ++x) {
    std::array<float, 4> weights;
    for (int k = 0; k < 4; ++k) {
      weights[std::size_t(k)] = level == 1 ? logit(x, Network::kPixelKeep + k, y)
                                           : logit(2 * x + k % 2, Network::kKeep, 2 * y + k / 2);
    }
    const float most = std::ranges::max(weights);
    for (float& weight : weights) weight = fast_exp(std::max(weight - most, kLeastExponent));
    const float scale = 1.0f / ((weights[0] + weights[1]) + (weights[2] + weights[3]));
    for (int layer = 0; layer < kPair; ++layer) {
      float sum = 0.0f;
      for (int k = 0; k < 4; ++k) {
        sum += weights[std::size_t(k)] *
               *pairs_[level - 1].row(2 * y + k / 2).at(layer, 2 * x + k % 2);
      }
      *out.at(layer, x) = sum * scale;
    }
    for (const int layer : {kNoise, kShade}) {
      float sum = 0.0f;
      for (int k = 0; k < 4; ++k) {
        sum += *pairs_[level - 1].row(2 * y + k / 2).at(layer, 2 * x + k % 2);
      }
      *out.at(layer, x) = 0.25f * sum;
    }
  }
}

/// From logits to weights of `count` taps, whose rows lie `stride` apart. The largest becomes 1:
/// networks learn logits far beyond what a sum of exponentials can hold.
inline void weigh_taps(float* logits, std::size_t count, std::size_t stride) {
  std::vector<float> most(logits, logits + stride);
  for (std::size_t k = 1; k < count; ++k) {
    const float* __restrict row = logits + k * stride;
    float* __restrict to = most.data();
    for (std::size_t x = 0; x < stride; ++x) to[x] = std::max(to[x], row[x]);
  }
  for (std::size_t k = 0; k < count; ++k) {
    float* __restrict row = logits + k * stride;
    const float* __restrict from = most.data();
    for (std::size_t x = 0; x < stride; ++x) {
      row[x] = fast_exp(std::max(row[x] - from[x], kLeastExponent));
    }
  }
}

/// exp() of shares' logits in place.
inline void exponentiate(float* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = fast_exp(std::min(std::max(values[i], -kLargestLogit), kLargestLogit));
  }
}

/// Sums of the level's own pixels and of the next level's results around row `y`, by weights per
/// tap that lie `stride` apart, as do the sums of a layer.
template <int kWide>
inline void TileFilter::sum_taps(std::size_t level, int y, const float* weights, std::size_t stride,
                                 float* sums) {
  using Numbers [[gnu::vector_size(4 * kWide)]] = float;
  using Loose [[gnu::vector_size(4 * kWide), gnu::aligned(4), gnu::may_alias]] = float;
  struct Tap {
    const float* from;  ///< Of the first layer.
    std::size_t layer_stride;
    const float* weights;
  };
  const int width = width_ >> level;
  const int height = height_ >> level;
  std::array<Tap, Network::kFine + Network::kCoarse> taps;
  std::size_t count = 0;
  for (int dy = -kReach; dy <= kReach; ++dy) {
    if (y + dy < 0 || y + dy >= height) continue;
    const auto row = pairs_[level].row(y + dy);
    for (int dx = -kReach; dx <= kReach; ++dx) {
      const int tap = (dy + kReach) * kSide + dx + kReach;
      taps[count++] = {row.at(kLight, dx), row.stride, weights + std::size_t(tap) * stride};
    }
  }
  // The next level's rows, each number twice.
  std::vector<float> wide;
  if (level < Network::kDepth) {
    const std::size_t wide_stride = stride + 2 * kMargin;
    wide.resize(3 * kPair * wide_stride);
    for (int dy = -1; dy <= 1; ++dy) {
      const int next_y = y / 2 + dy;
      if (next_y < 0 || next_y >= height / 2) continue;
      const auto next = results_[level + 1].row(next_y);
      float* const first = wide.data() + std::size_t(dy + 1) * kPair * wide_stride + kMargin;
      for (int layer = 0; layer < kPair; ++layer) {
        const float* __restrict from = next.at(layer, 0);
        float* __restrict to = first + std::size_t(layer) * wide_stride;
        for (int x = 0; x < width / 2; ++x) to[2 * x] = to[2 * x + 1] = from[x];
      }
      for (int dx = -1; dx <= 1; ++dx) {
        const int tap = Network::kFine + (dy + 1) * 3 + dx + 1;
        taps[count++] = {first + 2 * dx, wide_stride, weights + std::size_t(tap) * stride};
      }
    }
  }
  for (std::size_t x = 0; x < std::size_t(width); x += kWide) {
    Numbers totals[kPair] = {};
    for (std::size_t t = 0; t < count; ++t) {
      const Numbers weight = *reinterpret_cast<const Loose*>(taps[t].weights + x);
      const float* from = taps[t].from + x;
#pragma GCC unroll 6
      for (int layer = 0; layer < kPair; ++layer, from += taps[t].layer_stride) {
        totals[layer] += weight * *reinterpret_cast<const Loose*>(from);
      }
    }
    for (std::size_t layer = 0; layer < kPair; ++layer) {
      *reinterpret_cast<Loose*>(sums + layer * stride + x) = totals[layer];
    }
  }
}

template <int kWide>
inline void TileFilter::filter(std::size_t level, int y) {
  const auto width = std::size_t(width_ >> level);
  const std::size_t stride = row_stride(width);
  const ChannelBlocks& logits = logits_.levels[level - 1];
  const int taps = Network::kFine + (level < Network::kDepth ? Network::kCoarse : 0);
  std::vector<float> weights(std::size_t(taps) * stride);
  for (int block = 0; block < logits.blocks(); ++block) {
    const float* from = logits.at(block, 0, y);
    const int first = block * ChannelBlocks::kWidth;
    const int count = std::min(ChannelBlocks::kWidth, taps - first);
    for (std::size_t x = 0; x < width; ++x, from += ChannelBlocks::kWidth) {
      for (int k = 0; k < count; ++k) weights[std::size_t(first + k) * stride + x] = from[k];
    }
  }
  weigh_taps(weights.data(), std::size_t(taps), stride);
  std::vector<float> sums(kPair * stride);
  sum_taps<kWide>(level, y, weights.data(), stride, sums.data());
  const auto out = results_[level].row(y);
  const auto own = pairs_[level].row(y);
  const float* const gains = logits.at(Network::kGain / ChannelBlocks::kWidth, 0, y) +
                             Network::kGain % ChannelBlocks::kWidth;
  for (std::size_t x = 0; x < width; ++x) {
    float total = 0.0f;
    for (int k = 0; k < taps; ++k) total += weights[std::size_t(k) * stride + x];
    const float logit = gains[x * ChannelBlocks::kWidth];
    const float gain =
        1.0f + kMostGain * noise_share(own, int(x)) * logit / (1.0f + std::abs(logit));
    for (int layer = 0; layer < kPair; ++layer) {
      const float sum = sums[std::size_t(layer) * stride + x] / total;
      *out.at(layer, int(x)) = layer < kColor ? gain * sum : sum;
    }
  }
  results_[level].fill_margins(y, {});
}

/// How much around a pixel there is to do: nothing, where nothing is noisy.
inline float TileFilter::needed(int x, int y) const {
  return noise_share(pairs_[kCalmLevel].row(y >> kCalmLevel), x >> kCalmLevel, kCalm);
}

/// Two rows of pixels.
template <int kWide>
inline void TileFilter::finish(int block_row) {
  constexpr int kBlock = ChannelBlocks::kWidth;
  const std::size_t stride = row_stride(std::size_t(width_));
  const auto half = std::size_t(width_ / 2);
  std::vector<float> blocks(std::size_t(network_.pixel_blocks()) * half * kBlock);
  network_.pixel_logits(logits_, block_row, isa_, blocks.data());
  // Of both rows, tap by tap: channel 4 k + 2 y + x of a block belongs to tap k.
  std::vector<float> weights(std::size_t(2 * Network::kPixelLogits) * stride);
  for (int block = 0; block < network_.pixel_blocks(); ++block) {
    const float* from = blocks.data() + std::size_t(block) * half * kBlock;
    const int count = std::min(kBlock, 4 * Network::kPixelLogits - block * kBlock);
    for (std::size_t u = 0; u < half; ++u, from += kBlock) {
      for (int i = 0; i < count; i += 2) {
        const int channel = block * kBlock + i;
        const auto row = std::size_t(channel / 4 + channel / 2 % 2 * Network::kPixelLogits);
        float* const to = weights.data() + row * stride + 2 * u;
        to[0] = from[i];
        to[1] = from[i + 1];
      }
    }
  }
  constexpr std::size_t kNext = Network::kFine + Network::kCoarse;
  for (std::size_t first : {std::size_t(0), std::size_t(Network::kPixelLogits)}) {
    float* const row = weights.data() + first * stride;
    weigh_taps(row, kNext, stride);
    weigh_taps(row + kNext * stride, Network::kOwn, stride);
    exponentiate(row + Network::kKernels * stride,
                 std::size_t(Network::kPixelLogits - Network::kKernels) * stride);
  }
  std::vector<float> sums(kPair * stride);
  std::vector<float> own(kPair * stride);
  std::vector<float> totals(stride);
  for (int part = 0; part < 2; ++part) {
    const int y = 2 * block_row + part;
    const int image_y = tile_.seen.y_min + y;
    if (y >= own_height_ || image_y < tile_.wanted.y_min || image_y >= tile_.wanted.y_max) continue;
    const float* const taps = weights.data() + std::size_t(part * Network::kPixelLogits) * stride;
    sum_taps<kWide>(0, y, taps, stride, sums.data());
    // The pixel's own colour and what it sees of lamps: beside the picture is its edge.
    std::fill(own.begin(), own.end(), 0.0f);
    std::fill(totals.begin(), totals.end(), 0.0f);
    for (int k = 0; k < Network::kOwn; ++k) {
      const int v = std::clamp(y + k / 3 - 1, 0, own_height_ - 1);
      const int shift = k % 3 - 1;
      const float* __restrict w =
          taps + std::size_t(Network::kFine + Network::kCoarse + k) * stride;
      for (int x = 0; x < own_width_; ++x) totals[std::size_t(x)] += w[x];
      for (int layer = 0; layer < kPair; ++layer) {
        const float* const row =
            layer < 3 ? pairs_[0].row(v).at(kColor + layer, 0) : seen_.row(v).at(layer - 3, 0);
        float* __restrict to = own.data() + std::size_t(layer) * stride;
        const int begin = std::max(0, -shift);
        const int end = std::min(own_width_, own_width_ - shift);
        if (begin > 0) to[0] += w[0] * row[0];
        for (int x = begin; x < end; ++x) to[x] += w[x] * row[x + shift];
        if (end < own_width_) to[own_width_ - 1] += w[own_width_ - 1] * row[own_width_ - 1];
      }
    }
    const auto noisy = pairs_[0].row(y);
    const auto seen = seen_.row(y);
    const auto row_of = [&](int logit) { return taps + std::size_t(logit) * stride; };
    const float* const gains = row_of(Network::kPixelGain);
    const float* const others = row_of(Network::kOther);
    const float* const stays = row_of(Network::kStays);
    for (int x = tile_.wanted.x_min - tile_.seen.x_min; x < tile_.wanted.x_max - tile_.seen.x_min;
         ++x) {
      Vec3f& color = image_.at(tile_.seen.x_min + x, image_y);
      const float gain =
          1.0f + kMostGain * noise_share(noisy, x) * (1.0f - 2.0f / (1.0f + gains[x]));
      const float own_share = needed(x, y) / (1.0f + others[x]);
      const float stay = stays[x] / (1.0f + stays[x]);
      const Vec3f other = finite(color);
      for (int k = 0; k < 3; ++k) {
        const auto layer = [&](const std::vector<float>& values, int number) {
          return values[std::size_t(number) * stride + std::size_t(x)];
        };
        const float irradiance =
            gain * layer(sums, k) / std::max(layer(sums, kColor + k), kSmallest);
        float clean = (irradiance * layer(own, k) + layer(own, 3 + k)) / totals[std::size_t(x)];
        clean = other[k] + own_share * (clean - other[k]);
        color[k] = clean + stay * (*noisy.at(kLight + k, x) + *seen.at(k, x) - clean);
      }
    }
  }
}

}  // namespace

std::size_t network_filter_bytes(int width, int height) {
  std::size_t most = 0;
  for (const Tile& tile : tiles_of(width, height)) {
    const PixelBox& seen = tile.seen;
    most = std::max(most, std::size_t(aligned(seen.x_max - seen.x_min)) *
                              std::size_t(aligned(seen.y_max - seen.y_min)));
  }
  return most * kTileBytesPerPixel;
}

Image<Vec3f> filtered_by_network(const Film& film, Image<Vec3f> other,
                                 const DenoiseSettings& settings, double exposure, Isa isa,
                                 Host& host) {
  for (const Tile& tile : tiles_of(film.width(), film.height())) {
    TileFilter(film, other, tile, settings, float(exposure), isa, host).run();
  }
  return other;
}

}  // namespace diorama
