// SPDX-License-Identifier: Apache-2.0
#include "plane_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "forget_pages.h"
#include "pixel_layers.h"
#include "sampling.h"

namespace diorama {
namespace {

// Few neighbours in many rounds: 25 instead of 9 of them gain nothing (measured) and cost twice.
constexpr int kRounds = 5;
constexpr int kMargin = 1 << (kRounds - 1);  // pixels beside the picture that the last round reads
constexpr float kOwnShare = 6 / 14.0f;       // of the kernel along one axis
constexpr float kOtherShare = 4 / 14.0f;
constexpr float kLuminanceSlack = 4.0f;  // standard deviations
constexpr float kNormalSharpness = 10.0f;
constexpr float kPlaneSlack = 0.016f;  // of the distance from the camera
constexpr float kMinAlbedo = 0.02f;
// Where the samples of a pixel met surfaces that face many ways (glass, edges), their means say
// little of how alike two such pixels are.
constexpr float kMixedTolerance = 100.0f;
// Below this share of agreeing neighbours a pixel was hardly averaged: edges, thin things.
constexpr float kLowSupport = 0.35f;
// So many averaged pixels near one of low support make it suspect.
constexpr float kValidNeighbours = 10.0f;
constexpr float kLeeway = 2.0f;  // by which it may leave their range

// Of the paths of one pixel: what so many may bring each, one of more may bring for all of them.
constexpr float kLimitedPaths = 16.0f;
// A path may be so many times as bright as the others around it, whatever the limit.
constexpr float kTimesOthers = 4.0f;

constexpr int kBlock = 16;             // pixels of a square whose light is summed up
constexpr float kMostReturned = 1.5f;  // of the light that is left

/// What steers the filter; constant over the rounds. Normals are zero where there is no surface;
/// positions are as seen from the camera.
enum Guide { kNormal = 0, kPosition = 3, kNormalConfidence = 6, kGuides = 7 };
/// How much differences from a pixel mean, in (0, 1]; without a surface it differs from all others.
constexpr float kNoSurface = 1e6f;

/// Light that falls on the pixels' surfaces, whatever their colour.
enum Incoming {
  kIrradiance = 0,
  kLuminance = 3,  ///< Of the irradiance.
  kVariance = 4,   ///< Of the luminance.
  kCertainty = 5,  ///< See measure().
  kIncoming = 6
};

using Guides = PixelLayers<kGuides>;
using Lights = PixelLayers<kIncoming>;

/// exp(-16 x) for x >= 0, from 1 - x, to 2 %: one weight of many need not be better.
inline Lanes fast_exp16(const Lanes& one_less) {
  const Lanes base = larger(Lanes{}, one_less);
  const Lanes b2 = base * base;
  const Lanes b4 = b2 * b2;
  const Lanes b8 = b4 * b4;
  return b8 * b8;
}

inline Lanes luminances(const Lanes3& rgb) {
  return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
}

inline void store_irradiance(const Lanes3& rgb, const Lights::Row& light, int x) {
  store_lanes(rgb.x, light.at(kIrradiance, x));
  store_lanes(rgb.y, light.at(kIrradiance + 1, x));
  store_lanes(rgb.z, light.at(kIrradiance + 2, x));
  store_lanes(luminances(rgb), light.at(kLuminance, x));
}

inline bool has_any(const Lanes& numbers) {
  using Bits [[gnu::vector_size(4 * kLanes)]] = std::int64_t;
  const auto bits = Bits(numbers);
  return (bits[0] | bits[1] | bits[2] | bits[3]) != 0;
}

/// 1 for surfaces, 0 elsewhere.
inline Lanes surfaces(const Guides::Row& guides, int x) {
  return guides.lanes(kNormalConfidence, x) < kNoSurface ? all_lanes(1.0f) : Lanes{};
}

class PlaneFilter {
 public:
  /// `spent`: the same film, where its memory is to be given back.
  PlaneFilter(const Film& film, Film* spent, const DenoiseSettings& settings, Isa isa, Host& host)
      : film_(film),
        spent_(spent),
        settings_(settings),
        isa_(isa),
        host_(host),
        width_(film.width()),
        height_(film.height()),
        guides_(width_, height_, kMargin),
        lights_(width_, height_, kMargin),
        columns_((width_ + kBlock - 1) / kBlock),
        block_rows_((height_ + kBlock - 1) / kBlock),
        before_(std::size_t(columns_ * block_rows_)),
        after_(before_.size()),
        albedo_(std::size_t(width_) * std::size_t(height_)),
        image_(width_, height_, Vec3f::Zero()) {}

  Image<Vec3f> run();

 private:
  enum class Step : std::uint8_t { Read, Tame, Measure, Filter, Weigh, Finish };

  /// Does one step for all rows. Steps read lights_ and leave their result in next_, but for Read
  /// and Measure, which add to lights_.
  void all_rows(Step step, int round = 0);
  void rows(Step step, int round, int begin, int end);
  void rows_sse42(Step step, int round, int begin, int end);
  void rows_avx2(Step step, int round, int begin, int end);
  void rows_avx512(Step step, int round, int begin, int end);
  void read(int y);
  Vec3f believable(int x, int y, float& variance, float& removed) const;
  void clamp_fireflies(int y);
  void weigh(const Lights& light, int y_begin, std::vector<float>& sums) const;
  void measure(int y);
  int row_by_reach(int index, int reach) const;
  void filter(int y, int round);
  void limit_outliers(int y);
  Lanes outlier_scale(int x, int y, const Lanes& low_support) const;
  std::vector<float> lost() const;
  void restore_removed_energy(int y);
  void write(int y);

  const Film& film_;  ///< Is read in the first step alone.
  Film* spent_;
  DenoiseSettings settings_;
  Isa isa_;
  Host& host_;
  int width_;
  int height_;
  Guides guides_;
  Lights lights_;
  Lights next_;  ///< After the film.
  /// After the film: share of the neighbours that agreed in the first round.
  PixelLayers<1> support_;
  // Sums of luminance over blocks of pixels, as sampled and filtered.
  int columns_;
  int block_rows_;
  std::vector<float> before_;
  std::vector<float> after_;
  std::vector<float> lost_;  ///< By block.
  HugePages<Vec3f> albedo_;
  Image<Vec3f> image_;  ///< What is seen without scattering, then all.
};

/// The rows in the order 0, reach, 2 reach, ..., 1, 1 + reach, ...: each then needs two of the rows
/// that the one before it has read, and one more from memory.
inline int PlaneFilter::row_by_reach(int index, int reach) const {
  int first = 0;
  while (true) {
    const int count = (height_ - first + reach - 1) / reach;
    if (index < count) return first + index * reach;
    index -= count;
    ++first;
  }
}

inline void PlaneFilter::rows(Step step, int round, int begin, int end) {
  for (int y = begin; y < end; ++y) {
    switch (step) {
      case Step::Read:
        read(y);
        break;
      case Step::Tame:
        next_.fill_margins(y, {});
        support_.fill_margins(y, {});
        clamp_fireflies(y);
        break;
      case Step::Measure:
        measure(y);
        break;
      case Step::Filter:
        filter(row_by_reach(y, 1 << round), round);
        break;
      case Step::Weigh:
        break;
      case Step::Finish:
        limit_outliers(y);
        restore_removed_energy(y);
        write(y);
        break;
    }
  }
  // But for what the blocks above and below look at. Smaller films are used again as a whole.
  const bool is_forgotten = spent_ != nullptr && !SparePages::keeps(spent_->pixels().size_bytes());
  if (step == Step::Read && is_forgotten && end - begin > 2) {
    const auto width = std::size_t(width_);
    forget_pages(spent_->pixels().subspan(std::size_t(begin + 1) * width,
                                          std::size_t(end - begin - 2) * width));
  }
  if (step == Step::Tame) weigh(lights_, begin, before_);
  if (step == Step::Weigh) weigh(lights_, begin, after_);
}

#define DIORAMA_KERNEL(NAME, ARCH)                                                         \
  [[gnu::target("arch=" ARCH), gnu::flatten]] void PlaneFilter::NAME(Step step, int round, \
                                                                     int begin, int end) { \
    rows(step, round, begin, end);                                                         \
  }
DIORAMA_KERNEL(rows_sse42, "x86-64-v2")
DIORAMA_KERNEL(rows_avx2, "x86-64-v3")
DIORAMA_KERNEL(rows_avx512, "x86-64-v4")
#undef DIORAMA_KERNEL

void PlaneFilter::all_rows(Step step, int round) {
  host_.parallel_for(std::size_t(block_rows_), [&](std::size_t task) {
    const int begin = int(task) * kBlock;
    const int end = std::min(height_, begin + kBlock);
    switch (isa_) {
      case Isa::Sse2:
        return rows(step, round, begin, end);
      case Isa::Sse42:
        return rows_sse42(step, round, begin, end);
      case Isa::Avx2:
        return rows_avx2(step, round, begin, end);
      case Isa::Avx512:
        return rows_avx512(step, round, begin, end);
    }
  });
}

Image<Vec3f> PlaneFilter::run() {
  all_rows(Step::Read);
  if (spent_ != nullptr) *spent_ = Film();
  next_ = Lights(width_, height_, kMargin);
  support_ = PixelLayers<1>(width_, height_, kMargin);
  all_rows(Step::Tame);
  std::swap(lights_, next_);
  for (int round = 0; round < kRounds; ++round) {
    all_rows(Step::Measure);
    all_rows(Step::Filter, round);
    std::swap(lights_, next_);
  }
  all_rows(Step::Weigh);
  lost_ = lost();
  all_rows(Step::Finish);
  return std::move(image_);
}

/// The pixel's light without what its brightest path brings beyond belief.
Vec3f PlaneFilter::believable(int x, int y, float& variance, float& removed) const {
  const FilmPixel& pixel = film_.at(x, y);
  variance = pixel.variance;
  removed = 0.0f;
  const bool is_limited = settings_.brightest_path > 0.0f && pixel.count > 1.5f;
  const float times = std::max(1.0f, pixel.count / kLimitedPaths);
  if (!is_limited || pixel.brightest <= settings_.brightest_path * times) return pixel.scattered;
  float others = 0.0f;
  float count = 0.0f;
  for (int v = std::max(0, y - 1); v < std::min(height_, y + 2); ++v) {
    for (int u = std::max(0, x - 1); u < std::min(width_, x + 2); ++u) {
      const FilmPixel& near = film_.at(u, v);
      others += luminance(near.scattered) * near.count - near.brightest;
      count += near.count - 1.0f;
    }
  }
  const float most =
      times * (settings_.brightest_path + kTimesOthers * std::max(0.0f, others) / count);
  const float own = luminance(pixel.scattered);
  removed = std::min(own, (pixel.brightest - most) / pixel.count);
  if (removed <= 0.0f) {
    removed = 0.0f;
    return pixel.scattered;
  }
  // As if that path had been as bright as it may be.
  const double n = double(pixel.count);
  const double less = double(own) - double(removed);
  const double squares = double(pixel.variance) * (n - 1.0) + double(own) * double(own) -
                         (std::pow(double(pixel.brightest), 2) - std::pow(double(most), 2)) / n;
  variance = float(std::max(0.0, squares - less * less) / (n - 1.0));
  return pixel.scattered * float(less / double(own));
}

void PlaneFilter::read(int y) {
  guides_.fill_margins(y, {0, 0, 0, 0, 0, 0, kNoSurface});
  lights_.fill_margins(y, {});
  const auto guides = guides_.row(y);
  const auto light = lights_.row(y);
  float* const removed_of_block = &before_[std::size_t(y / kBlock * columns_)];
  if (y % kBlock == 0) std::fill_n(removed_of_block, columns_, 0.0f);
  for (int x = 0; x < width_; ++x) {
    const FilmPixel& pixel = film_.at(x, y);
    const bool is_surface = pixel.surface_share > 0.0f;
    const float length = pixel.normal.norm();
    Vec3f normal = length > 1e-6f ? Vec3f(pixel.normal / length) : Vec3f(Vec3f::UnitZ());
    if (!is_surface) normal.setZero();
    const Vec3f position = pixel.position - settings_.view_position;
    const Vec3f color = pixel.albedo.cwiseMax(kMinAlbedo);
    float variance;
    float removed;
    const Vec3f irradiance = believable(x, y, variance, removed).cwiseQuotient(color);
    for (int k = 0; k < 3; ++k) {
      *guides.at(kNormal + k, x) = normal[k];
      *guides.at(kPosition + k, x) = position[k];
      *light.at(kIrradiance + k, x) = irradiance[k];
    }
    *light.at(kLuminance, x) = luminance(irradiance);
    *guides.at(kNormalConfidence, x) =
        is_surface ? 1.0f / (1.0f + kMixedTolerance * std::max(0.0f, 1.0f - length)) : kNoSurface;
    const float own_color = luminance(color);
    *light.at(kVariance, x) = variance / (own_color * own_color);
    removed_of_block[x / kBlock] += removed / own_color;
    albedo_.data()[std::size_t(y) * std::size_t(width_) + std::size_t(x)] = color;
    image_.at(x, y) = pixel.seen;
  }
}

/// Samples that are far brighter than everything around them are chance finds; the brightest
/// believable value is the third brightest neighbour's.
inline void PlaneFilter::clamp_fireflies(int y) {
  const int v_begin = std::max(0, y - 2);
  const int v_end = std::min(height_, y + 3);
  const auto light = lights_.row(y);
  const auto clamped = next_.row(y);
  for (int x = 0; x < width_; x += kLanes) {
    const Lanes zero{};
    Lanes first{};
    Lanes second{};
    Lanes third{};
    Lanes neighbours = zero - 1.0f;  // does not count itself
    for (int v = v_begin; v < v_end; ++v) {
      const auto other = lights_.row(v);
      const auto guides = guides_.row(v);
      for (int dx = -2; dx <= 2; ++dx) {
        const Lanes is_surface = surfaces(guides, x + dx);
        neighbours += is_surface;
        if (v == y && dx == 0) continue;
        const Lanes value = is_surface * other.lanes(kLuminance, x + dx);
        const Lanes below_first = smaller(first, value);
        first = larger(first, value);
        const Lanes below_second = smaller(second, below_first);
        second = larger(second, below_first);
        third = larger(third, below_second);
      }
    }
    const Lanes3 irradiance = light.lanes3(kIrradiance, x);
    const Lanes own = light.lanes(kLuminance, x);
    const Lanes judged = neighbours >= 8.0f ? surfaces(guides_.row(y), x) : zero;
    const Lanes suspect = own > third ? judged : zero;
    const Lanes scale = suspect > zero ? third / larger(own, all_lanes(1e-30f)) : zero + 1.0f;
    store_irradiance({irradiance.x * scale, irradiance.y * scale, irradiance.z * scale}, clamped,
                     x);
    store_lanes(light.lanes(kVariance, x) * scale * scale, clamped.at(kVariance, x));
  }
}

/// Adds to what the blocks have.
void PlaneFilter::weigh(const Lights& light, int y_begin, std::vector<float>& sums) const {
  const int y_end = std::min(height_, y_begin + kBlock);
  for (int column = 0; column < columns_; ++column) {
    const int x_end = std::min(width_, (column + 1) * kBlock);
    float sum = 0.0f;
    for (int y = y_begin; y < y_end; ++y) {
      const auto row = light.row(y);
      for (int x = column * kBlock; x < x_end; ++x) sum += *row.at(kLuminance, x);
    }
    sums[std::size_t(y_begin / kBlock * columns_ + column)] += sum;
  }
}

/// Certainty is 1 / the difference of luminance that noise explains; half of it, because two pixels
/// have a say, and scaled for fast_exp16(). Variances of few samples are noisy themselves: they are
/// smoothed.
inline void PlaneFilter::measure(int y) {
  const auto own = lights_.row(y);
  for (int x = 0; x < width_; x += kLanes) {
    Lanes sum{};
    Lanes weights{};
    for (int v = std::max(0, y - 1); v < std::min(height_, y + 2); ++v) {
      const auto light = lights_.row(v);
      const auto guides = guides_.row(v);
      for (int dx = -1; dx <= 1; ++dx) {
        const float w = (dx == 0 ? 2.0f : 1.0f) * (v == y ? 2.0f : 1.0f);
        sum += w * light.lanes(kVariance, x + dx);
        weights += w * surfaces(guides, x + dx);
      }
    }
    const Lanes variance = sum / larger(weights, all_lanes(1.0f));
    const Lanes explained =
        kLuminanceSlack * square_roots(variance) + 1e-4f * own.lanes(kLuminance, x) + 1e-8f;
    store_lanes((0.5f / 16.0f) / explained, own.at(kCertainty, x));
  }
}

constexpr float kTurn = kNormalSharpness / 16.0f;

/// Eight pixels whose neighbours are averaged. Scaled for fast_exp16(), and few enough numbers to
/// stay in registers.
struct Centre {
  Lanes3 normal;  ///< kTurn long.
  Lanes plane;    ///< Where the plane is along `normal`.
  Lanes slack;    ///< Weight of a distance from the plane, along `normal`.
  Lanes normal_confidence;
  Lanes luminance;
  Lanes certainty;
};

struct FilterSums {
  Lanes3 irradiance;
  Lanes variance{};
  Lanes weights{};
};

/// Differences of luminance count by the certainty of both pixels: if a dark pixel, which mostly
/// believes itself certain, had the only say, bright ones would be left out and pictures darken.
inline void add_neighbours(const Centre& own, const Guides::Row& guides, const Lights::Row& light,
                           int x, float share, FilterSums& sums) {
  const Lanes3& n = own.normal;
  const Lanes3 position = guides.lanes3(kPosition, x);
  const Lanes3 normal = guides.lanes3(kNormal, x);
  // In this order every step is one multiplication with an addition.
  const Lanes off_plane = n.z * position.z + (n.y * position.y + (n.x * position.x - own.plane));
  Lanes unlike = own.slack * magnitude(off_plane) + kTurn;
  unlike = unlike - n.x * normal.x;
  unlike = unlike - n.y * normal.y;
  unlike = unlike - n.z * normal.z;
  const Lanes normal_confidence = larger(own.normal_confidence, guides.lanes(kNormalConfidence, x));
  const Lanes brighter = magnitude(light.lanes(kLuminance, x) - own.luminance);
  const Lanes certainty = own.certainty + light.lanes(kCertainty, x);
  const Lanes alike = (1.0f - unlike * normal_confidence) - brighter * certainty;
  const Lanes w = share * fast_exp16(alike);
  const Lanes3 irradiance = light.lanes3(kIrradiance, x);
  sums.irradiance.x += w * irradiance.x;
  sums.irradiance.y += w * irradiance.y;
  sums.irradiance.z += w * irradiance.z;
  sums.variance += w * w * light.lanes(kVariance, x);
  sums.weights += w;
}

inline Centre centre_of(const Guides::Row& guides, const Lights::Row& light, int x) {
  const Lanes3 position = guides.lanes3(kPosition, x);
  const Lanes3 normal = guides.lanes3(kNormal, x);
  Centre centre;
  centre.normal = {kTurn * normal.x, kTurn * normal.y, kTurn * normal.z};
  centre.plane = dot(centre.normal, position);
  centre.slack =
      (1.0f / (16.0f * kTurn)) / (kPlaneSlack * square_roots(dot(position, position)) + 1e-6f);
  centre.normal_confidence = guides.lanes(kNormalConfidence, x);
  centre.luminance = light.lanes(kLuminance, x);
  centre.certainty = light.lanes(kCertainty, x);
  return centre;
}

inline void PlaneFilter::filter(int y, int round) {
  const int reach = 1 << round;
  const auto guides = guides_.row(y);
  const auto light = lights_.row(y);
  const auto filtered = next_.row(y);
  // Too many streams for the processor to foresee.
  const int coming = std::min(y + 2 * reach, height_ - 1);
  const auto coming_guides = guides_.row(coming);
  const auto coming_light = lights_.row(coming);
  for (int x = 0; x < width_; x += kLanes) {
    coming_guides.fetch(x);
    coming_light.fetch(x);
    const Centre own = centre_of(guides, light, x);
    FilterSums sums;
    for (int v = y - reach; v <= y + reach; v += reach) {
      if (v < 0 || v >= height_) continue;
      const auto other_guides = guides_.row(v);
      const auto other_light = lights_.row(v);
      const float share = v == y ? kOwnShare : kOtherShare;
      add_neighbours(own, other_guides, other_light, x - reach, share * kOtherShare, sums);
      add_neighbours(own, other_guides, other_light, x, share * kOwnShare, sums);
      add_neighbours(own, other_guides, other_light, x + reach, share * kOtherShare, sums);
    }
    // Pixels without a surface have no weight and stay black.
    const Lanes scale = surfaces(guides, x) / larger(sums.weights, all_lanes(1e-12f));
    const Lanes3 mean{sums.irradiance.x * scale, sums.irradiance.y * scale,
                      sums.irradiance.z * scale};
    store_irradiance(mean, filtered, x);
    store_lanes(sums.variance * scale * scale, filtered.at(kVariance, x));
    if (round > 0) continue;
    constexpr float kOwn = kOwnShare * kOwnShare;
    store_lanes((sums.weights - kOwn) * (1.0f / (1.0f - kOwn)), support_.row(y).at(0, x));
  }
}

/// Pixels that agree with none of their neighbours, mostly mixtures at edges, keep their noise;
/// they may at least be no darker and no brighter than what surrounds them.
inline void PlaneFilter::limit_outliers(int y) {
  const auto light = lights_.row(y);
  for (int x = 0; x < width_; x += kLanes) {
    const Lanes support = support_.row(y).lanes(0, x);
    const Lanes low_support = support < kLowSupport ? surfaces(guides_.row(y), x) : Lanes{};
    Lanes3 irradiance = light.lanes3(kIrradiance, x);
    if (has_any(low_support)) {
      const Lanes scale = outlier_scale(x, y, low_support);
      irradiance = {irradiance.x * scale, irradiance.y * scale, irradiance.z * scale};
    }
    store_irradiance(irradiance, next_.row(y), x);
  }
}

/// By how much eight pixels of which some have low support become brighter or darker.
inline Lanes PlaneFilter::outlier_scale(int x, int y, const Lanes& low_support) const {
  const Lanes zero{};
  Lanes low = all_lanes(kInfinite);
  Lanes high{};
  Lanes valid_neighbours{};
  for (int v = std::max(0, y - 2); v < std::min(height_, y + 3); ++v) {
    const auto guides = guides_.row(v);
    const auto other = lights_.row(v);
    for (int dx = -2; dx <= 2; ++dx) {
      const Lanes support = support_.row(v).lanes(0, x + dx);
      const Lanes counts = support >= kLowSupport ? surfaces(guides, x + dx) : zero;
      const Lanes value = other.lanes(kLuminance, x + dx);
      low = counts > zero ? smaller(low, value) : low;
      high = larger(high, counts * value);
      valid_neighbours += counts;
    }
  }
  const Lanes own = lights_.row(y).lanes(kLuminance, x);
  const Lanes limited = smaller(larger(own, low * (1.0f / kLeeway)), high * kLeeway);
  const Lanes judged = valid_neighbours >= kValidNeighbours ? low_support : zero;
  const Lanes changed = own > zero ? judged : zero;
  return changed > zero ? limited / larger(own, all_lanes(1e-30f)) : zero + 1.0f;
}

/// By how much the light around the middles of blocks was weakened.
std::vector<float> PlaneFilter::lost() const {
  std::vector<float> shares;
  shares.reserve(before_.size());
  for (int block_row = 0; block_row < block_rows_; ++block_row) {
    for (int column = 0; column < columns_; ++column) {
      float before = 0.0f;
      float after = 1e-12f;
      for (int v = std::max(0, block_row - 1); v < std::min(block_rows_, block_row + 2); ++v) {
        for (int u = std::max(0, column - 1); u < std::min(columns_, column + 2); ++u) {
          const float w = (v == block_row ? 2.0f : 1.0f) * (u == column ? 2.0f : 1.0f);
          before += w * before_[std::size_t(v * columns_ + u)];
          after += w * after_[std::size_t(v * columns_ + u)];
        }
      }
      shares.push_back(std::clamp(before / after, 1.0f, kMostReturned));
    }
  }
  return shares;
}

/// The light that was cut off or left out comes back, spread over a wide neighbourhood: pictures
/// would be too dark otherwise.
inline void PlaneFilter::restore_removed_energy(int y) {
  const auto light = next_.row(y);
  // Between the middles of blocks.
  const float v = std::max(0.0f, (float(y) + 0.5f) / float(kBlock) - 0.5f);
  const int upper = int(v);
  const int lower = std::min(upper + 1, block_rows_ - 1);
  const float down = v - float(upper);
  const auto at_column = [&](int column) {
    const int u = std::clamp(column, 0, columns_ - 1);
    return (1.0f - down) * lost_[std::size_t(upper * columns_ + u)] +
           down * lost_[std::size_t(lower * columns_ + u)];
  };
  for (int column = 0; column <= columns_; ++column) {
    const float left = at_column(column - 1);
    const float slope = (at_column(column) - left) / float(kBlock);
    const int middle = column * kBlock - kBlock / 2;
    for (int x = std::max(0, middle); x < std::min(width_, middle + kBlock); ++x) {
      const float scale = left + slope * (float(x - middle) + 0.5f);
      for (int k = 0; k < 3; ++k) *light.at(kIrradiance + k, x) *= scale;
    }
  }
}

void PlaneFilter::write(int y) {
  const Vec3f* albedo = albedo_.data() + std::size_t(y) * std::size_t(width_);
  for (int x = 0; x < width_; ++x, ++albedo) {
    Vec3f& color = image_.at(x, y);
    for (int k = 0; k < 3; ++k) color[k] += *next_.row(y).at(kIrradiance + k, x) * (*albedo)[k];
  }
}

}  // namespace

Image<Vec3f> filtered_on_planes(Film&& film, const DenoiseSettings& settings, Isa isa, Host& host) {
  Film spent = std::move(film);
  return PlaneFilter(spent, &spent, settings, isa, host).run();
}

Image<Vec3f> filtered_on_planes(const Film& film, const DenoiseSettings& settings, Isa isa,
                                Host& host) {
  return PlaneFilter(film, nullptr, settings, isa, host).run();
}

}  // namespace diorama
