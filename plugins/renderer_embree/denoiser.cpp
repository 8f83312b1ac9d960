// SPDX-License-Identifier: Apache-2.0
#include "denoiser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "lanes.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr int kRounds = 5;
constexpr std::array<float, 5> kKernel{1 / 16.0f, 4 / 16.0f, 6 / 16.0f, 4 / 16.0f, 1 / 16.0f};
constexpr float kLuminanceSlack = 4.0f;  // standard deviations
constexpr float kNormalSharpness = 10.0f;
constexpr float kPlaneSlack = 0.016f;  // of the distance from the camera
constexpr float kMinAlbedo = 0.02f;
// Where the samples of a pixel met surfaces that face many ways (glass, edges), their means say
// little of how alike two such pixels are.
constexpr float kMixedTolerance = 100.0f;
// Below this share of agreeing neighbours a pixel was hardly averaged: edges, thin things.
constexpr float kLonely = 0.25f;
constexpr float kWitnesses = 10.0f;  // averaged pixels near a lonely one that make it suspect
constexpr float kLeeway = 2.0f;      // by which it may leave their range
constexpr float kInfinite = std::numeric_limits<float>::infinity();

constexpr int kRowsPerTask = 8;
constexpr int kBlock = 16;             // pixels of a square whose tamed light is summed up
constexpr float kMostReturned = 1.3f;  // of the light that is left

/// One number per pixel. Rows start and end with as many zeros as the widest round reaches, so that
/// whole groups of pixels can be read anywhere near the picture.
class Plane {
 public:
  Plane(int width, int height)
      : stride_(std::size_t((width + kLanes - 1) / kLanes * kLanes + 2 * kMargin)),
        values_(stride_ * std::size_t(height), 0.0f) {}
  /// The pixel (0, y).
  float* row(int y) { return &values_[std::size_t(y) * stride_ + kMargin]; }
  const float* row(int y) const { return &values_[std::size_t(y) * stride_ + kMargin]; }

 private:
  static constexpr int kMargin = 2 << (kRounds - 1);
  std::size_t stride_;
  std::vector<float> values_;
};

inline Lanes3 load3(const std::array<Plane, 3>& planes, int y, int x) {
  return {load_lanes(planes[0].row(y) + x), load_lanes(planes[1].row(y) + x),
          load_lanes(planes[2].row(y) + x)};
}

/// exp(-x) for x >= 0, to 2 %: one weight out of 25 need not be better.
inline Lanes fast_exp(const Lanes& x) {
  const Lanes base = larger(Lanes{}, 1.0f - x * (1.0f / 16.0f));
  const Lanes b2 = base * base;
  const Lanes b4 = b2 * b2;
  const Lanes b8 = b4 * b4;
  return b8 * b8;
}

/// What steers the filter; constant over the rounds.
struct Guides {
  Guides(int width, int height)
      : normal{Plane(width, height), Plane(width, height), Plane(width, height)},
        position{normal},
        plane_scale(width, height),
        firmness(width, height),
        is_surface(width, height) {}

  std::array<Plane, 3> normal;
  std::array<Plane, 3> position;
  Plane plane_scale;  ///< 1 / tolerated distance from the plane.
  Plane firmness;     ///< In (0, 1]: how much differences from this pixel mean.
  Plane is_surface;   ///< 1, or 0: nothing to filter.
};

/// Light that falls on the pixels' surfaces, whatever their colour.
struct Incoming {
  Incoming(int width, int height)
      : irradiance{Plane(width, height), Plane(width, height), Plane(width, height)},
        luminance(width, height),
        variance(width, height) {}

  std::array<Plane, 3> irradiance;
  Plane luminance;
  Plane variance;
};

class Denoiser {
 public:
  Denoiser(const Film& film, const Vec3f& view_position, Isa isa, Host& host)
      : film_(film),
        view_position_(view_position),
        isa_(isa),
        host_(host),
        width_(film.width()),
        height_(film.height()),
        guides_(width_, height_),
        lights_(width_, height_),
        next_(width_, height_),
        columns_((width_ + kBlock - 1) / kBlock),
        block_rows_((height_ + kBlock - 1) / kBlock),
        before_(std::size_t(columns_ * block_rows_)),
        after_(before_.size()),
        luminance_scale_(width_, height_),
        support_(width_, height_) {}

  Image<Vec3f> run();

 private:
  enum class Step : std::uint8_t { Read, Tame, Weigh, Return, Measure, Filter, Calm, Write };

  /// Does one step for all rows. Steps read lights_ and leave their result there.
  void all_rows(Step step, int reach = 1);
  void rows(Step step, int reach, int begin, int end);
  void rows_sse42(Step step, int reach, int begin, int end);
  void rows_avx2(Step step, int reach, int begin, int end);
  void rows_avx512(Step step, int reach, int begin, int end);
  void read(int y);
  void tame(int y);
  void weigh(int block_row);
  void give_back(int y);
  void measure(int y);
  void filter(int y, int reach);
  void calm(int y);
  void write(int y);

  const Film& film_;
  Vec3f view_position_;
  Isa isa_;
  Host& host_;
  int width_;
  int height_;
  Guides guides_;
  Incoming lights_;
  Incoming next_;
  // Sums of luminance over blocks of pixels, as sampled and tamed.
  int columns_;
  int block_rows_;
  std::vector<float> before_;
  std::vector<float> after_;
  Plane luminance_scale_;  ///< 1 / difference of luminance that noise explains.
  Plane support_;          ///< Share of the neighbours that agreed in the first round.
  Image<Vec3f> image_;
};

inline void Denoiser::rows(Step step, int reach, int begin, int end) {
  for (int y = begin; y < end; ++y) {
    switch (step) {
      case Step::Read:
        read(y);
        break;
      case Step::Tame:
        tame(y);
        break;
      case Step::Weigh:
        if (y % kBlock == 0) weigh(y / kBlock);
        break;
      case Step::Return:
        give_back(y);
        break;
      case Step::Measure:
        measure(y);
        break;
      case Step::Filter:
        filter(y, reach);
        break;
      case Step::Calm:
        calm(y);
        break;
      case Step::Write:
        write(y);
        break;
    }
  }
}

#define DIORAMA_KERNEL(NAME, ARCH)                                                                 \
  [[gnu::target("arch=" ARCH), gnu::flatten]] void Denoiser::NAME(Step step, int reach, int begin, \
                                                                  int end) {                       \
    rows(step, reach, begin, end);                                                                 \
  }
DIORAMA_KERNEL(rows_sse42, "x86-64-v2")
DIORAMA_KERNEL(rows_avx2, "x86-64-v3")
DIORAMA_KERNEL(rows_avx512, "x86-64-v4")
#undef DIORAMA_KERNEL

void Denoiser::all_rows(Step step, int reach) {
  const int tasks = (height_ + kRowsPerTask - 1) / kRowsPerTask;
  host_.parallel_for(std::size_t(tasks), [&](std::size_t task) {
    const int begin = int(task) * kRowsPerTask;
    const int end = std::min(height_, begin + kRowsPerTask);
    switch (isa_) {
      case Isa::Sse2:
        return rows(step, reach, begin, end);
      case Isa::Sse42:
        return rows_sse42(step, reach, begin, end);
      case Isa::Avx2:
        return rows_avx2(step, reach, begin, end);
      case Isa::Avx512:
        return rows_avx512(step, reach, begin, end);
    }
  });
}

Image<Vec3f> Denoiser::run() {
  all_rows(Step::Read);
  next_ = lights_;
  all_rows(Step::Tame);
  all_rows(Step::Weigh);
  all_rows(Step::Return);
  std::swap(lights_, next_);
  for (int round = 0; round < kRounds; ++round) {
    all_rows(Step::Measure);
    all_rows(Step::Filter, 1 << round);
    std::swap(lights_, next_);
  }
  all_rows(Step::Calm);
  image_ = Image<Vec3f>(width_, height_, Vec3f::Zero());
  all_rows(Step::Write);
  return std::move(image_);
}

void Denoiser::read(int y) {
  for (int x = 0; x < width_; ++x) {
    const FilmPixel& pixel = film_.at(x, y);
    const bool is_surface = pixel.surface_share > 0.0f;
    const float length = pixel.normal.norm();
    const Vec3f normal = length > 1e-6f ? Vec3f(pixel.normal / length) : Vec3f(Vec3f::UnitZ());
    const Vec3f color = pixel.albedo.cwiseMax(kMinAlbedo);
    const Vec3f irradiance = pixel.scattered.cwiseQuotient(color);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = Eigen::Index(k);
      guides_.normal[k].row(y)[x] = normal[axis];
      guides_.position[k].row(y)[x] = pixel.position[axis];
      lights_.irradiance[k].row(y)[x] = irradiance[axis];
    }
    guides_.plane_scale.row(y)[x] =
        1.0f / (kPlaneSlack * (pixel.position - view_position_).norm() + 1e-6f);
    guides_.firmness.row(y)[x] = 1.0f / (1.0f + kMixedTolerance * std::max(0.0f, 1.0f - length));
    guides_.is_surface.row(y)[x] = is_surface ? 1.0f : 0.0f;
    lights_.luminance.row(y)[x] = luminance(irradiance);
    const float own_color = luminance(color);
    lights_.variance.row(y)[x] = pixel.variance / (own_color * own_color);
  }
}

/// Samples that are far brighter than everything around them are chance finds; the brightest
/// believable value is the third brightest neighbour's.
inline void Denoiser::tame(int y) {
  const int v_begin = std::max(0, y - 2);
  const int v_end = std::min(height_, y + 3);
  for (int x = 0; x < width_; x += kLanes) {
    const Lanes zero{};
    Lanes first{};
    Lanes second{};
    Lanes third{};
    Lanes neighbours = zero - 1.0f;  // does not count itself
    for (int v = v_begin; v < v_end; ++v) {
      for (int dx = -2; dx <= 2; ++dx) {
        const Lanes is_surface = load_lanes(guides_.is_surface.row(v) + x + dx);
        neighbours += is_surface;
        if (v == y && dx == 0) continue;
        Lanes value = is_surface * load_lanes(lights_.luminance.row(v) + x + dx);
        const Lanes below_first = smaller(first, value);
        first = larger(first, value);
        const Lanes below_second = smaller(second, below_first);
        second = larger(second, below_first);
        third = larger(third, below_second);
      }
    }
    const Lanes own = load_lanes(lights_.luminance.row(y) + x);
    const Lanes is_surface = load_lanes(guides_.is_surface.row(y) + x);
    const Lanes judged = neighbours >= 8.0f ? is_surface : zero;
    const Lanes suspect = own > third ? judged : zero;
    const Lanes scale = suspect > zero ? third / larger(own, all_lanes(1e-30f)) : zero + 1.0f;
    for (std::size_t k = 0; k < 3; ++k) {
      store_lanes(load_lanes(lights_.irradiance[k].row(y) + x) * scale,
                  next_.irradiance[k].row(y) + x);
    }
    store_lanes(own * scale, next_.luminance.row(y) + x);
    store_lanes(load_lanes(lights_.variance.row(y) + x) * scale * scale, next_.variance.row(y) + x);
  }
}

void Denoiser::weigh(int block_row) {
  const int y_end = std::min(height_, (block_row + 1) * kBlock);
  for (int column = 0; column < columns_; ++column) {
    const int x_end = std::min(width_, (column + 1) * kBlock);
    float before = 0.0f;
    float after = 0.0f;
    for (int y = block_row * kBlock; y < y_end; ++y) {
      for (int x = column * kBlock; x < x_end; ++x) {
        before += lights_.luminance.row(y)[x];
        after += next_.luminance.row(y)[x];
      }
    }
    const auto block = std::size_t(block_row * columns_ + column);
    before_[block] = before;
    after_[block] = after;
  }
}

/// The light that was cut off comes back, spread over a wide neighbourhood: pictures would be too
/// dark otherwise.
void Denoiser::give_back(int y) {
  for (int x = 0; x < width_; ++x) {
    const float u = (float(x) + 0.5f) / float(kBlock) - 0.5f;
    const float v = (float(y) + 0.5f) / float(kBlock) - 0.5f;
    float before = 0.0f;
    float after = 1e-12f;
    for (int row = int(std::ceil(v - 2.0f)); float(row) < v + 2.0f; ++row) {
      for (int column = int(std::ceil(u - 2.0f)); float(column) < u + 2.0f; ++column) {
        if (row < 0 || column < 0 || row >= block_rows_ || column >= columns_) continue;
        const float w = (2.0f - std::abs(float(row) - v)) * (2.0f - std::abs(float(column) - u));
        before += w * before_[std::size_t(row * columns_ + column)];
        after += w * after_[std::size_t(row * columns_ + column)];
      }
    }
    const float scale = std::clamp(before / after, 1.0f, kMostReturned);
    for (Plane& plane : next_.irradiance) plane.row(y)[x] *= scale;
    next_.luminance.row(y)[x] *= scale;
    next_.variance.row(y)[x] *= scale * scale;
  }
}

/// Variances of few samples are noisy themselves: they are smoothed.
inline void Denoiser::measure(int y) {
  for (int x = 0; x < width_; x += kLanes) {
    Lanes sum{};
    Lanes weights{};
    for (int dy = -1; dy <= 1; ++dy) {
      if (y + dy < 0 || y + dy >= height_) continue;
      for (int dx = -1; dx <= 1; ++dx) {
        const float w = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
        sum += w * load_lanes(lights_.variance.row(y + dy) + x + dx);
        weights += w * load_lanes(guides_.is_surface.row(y + dy) + x + dx);
      }
    }
    const Lanes variance = sum / larger(weights, all_lanes(1.0f));
    Lanes deviation;
    for (int i = 0; i < kLanes; ++i) deviation[i] = std::sqrt(variance[i]);
    const Lanes own = load_lanes(lights_.luminance.row(y) + x);
    store_lanes(1.0f / (kLuminanceSlack * deviation + 1e-4f * own + 1e-8f),
                luminance_scale_.row(y) + x);
  }
}

inline void Denoiser::filter(int y, int reach) {
  for (int x = 0; x < width_; x += kLanes) {
    const Lanes3 normal = load3(guides_.normal, y, x);
    const Lanes3 position = load3(guides_.position, y, x);
    const Lanes plane_scale = load_lanes(guides_.plane_scale.row(y) + x);
    const Lanes firmness = load_lanes(guides_.firmness.row(y) + x);
    const Lanes own = load_lanes(lights_.luminance.row(y) + x);
    const Lanes luminance_scale = load_lanes(luminance_scale_.row(y) + x);
    Lanes3 sum;
    Lanes variance{};
    Lanes weights{};
    for (int dy = -2; dy <= 2; ++dy) {
      const int v = y + dy * reach;
      if (v < 0 || v >= height_) continue;
      for (int dx = -2; dx <= 2; ++dx) {
        const int u = x + dx * reach;
        const Lanes3 n = load3(guides_.normal, v, u);
        const Lanes3 p = load3(guides_.position, v, u);
        const Lanes cosine = normal.x * n.x + normal.y * n.y + normal.z * n.z;
        const Lanes off_plane = normal.x * (p.x - position.x) + normal.y * (p.y - position.y) +
                                normal.z * (p.z - position.z);
        const Lanes unlike =
            kNormalSharpness * larger(Lanes{}, 1.0f - cosine) + magnitude(off_plane) * plane_scale;
        const Lanes counts = larger(firmness, load_lanes(guides_.firmness.row(v) + u));
        const Lanes other = load_lanes(lights_.luminance.row(v) + u);
        const Lanes apart = unlike * counts + magnitude(other - own) * luminance_scale;
        const Lanes w = kKernel[std::size_t(dx + 2)] * kKernel[std::size_t(dy + 2)] *
                        load_lanes(guides_.is_surface.row(v) + u) * fast_exp(apart);
        const Lanes3 irradiance = load3(lights_.irradiance, v, u);
        sum.x += w * irradiance.x;
        sum.y += w * irradiance.y;
        sum.z += w * irradiance.z;
        variance += w * w * load_lanes(lights_.variance.row(v) + u);
        weights += w;
      }
    }
    // Pixels without a surface have no weight and stay black.
    constexpr float kOwn = kKernel[2] * kKernel[2];
    const Lanes is_surface = load_lanes(guides_.is_surface.row(y) + x);
    const Lanes scale = is_surface / larger(weights, all_lanes(1e-12f));
    sum = {sum.x * scale, sum.y * scale, sum.z * scale};
    store_lanes(sum.x, next_.irradiance[0].row(y) + x);
    store_lanes(sum.y, next_.irradiance[1].row(y) + x);
    store_lanes(sum.z, next_.irradiance[2].row(y) + x);
    store_lanes(0.2126f * sum.x + 0.7152f * sum.y + 0.0722f * sum.z, next_.luminance.row(y) + x);
    store_lanes(variance * scale * scale, next_.variance.row(y) + x);
    if (reach == 1) store_lanes((weights - kOwn) * (1.0f / (1.0f - kOwn)), support_.row(y) + x);
  }
}

/// Pixels that agree with none of their neighbours, mostly mixtures at edges, keep their noise;
/// they may at least be no darker and no brighter than what surrounds them.
inline void Denoiser::calm(int y) {
  const int v_begin = std::max(0, y - 2);
  const int v_end = std::min(height_, y + 3);
  for (int x = 0; x < width_; x += kLanes) {
    const Lanes zero{};
    Lanes low = all_lanes(kInfinite);
    Lanes high{};
    Lanes witnesses{};
    for (int v = v_begin; v < v_end; ++v) {
      for (int dx = -2; dx <= 2; ++dx) {
        const Lanes is_surface = load_lanes(guides_.is_surface.row(v) + x + dx);
        const Lanes support = load_lanes(support_.row(v) + x + dx);
        const Lanes counts = support >= kLonely ? is_surface : zero;
        const Lanes value = load_lanes(lights_.luminance.row(v) + x + dx);
        low = counts > zero ? smaller(low, value) : low;
        high = larger(high, counts * value);
        witnesses += counts;
      }
    }
    const Lanes own = load_lanes(lights_.luminance.row(y) + x);
    const Lanes support = load_lanes(support_.row(y) + x);
    const Lanes calm = smaller(larger(own, low * (1.0f / kLeeway)), high * kLeeway);
    const Lanes lonely = support < kLonely ? load_lanes(guides_.is_surface.row(y) + x) : zero;
    const Lanes judged = witnesses >= kWitnesses ? lonely : zero;
    const Lanes changed = own > zero ? judged : zero;
    const Lanes scale = changed > zero ? calm / larger(own, all_lanes(1e-30f)) : zero + 1.0f;
    for (std::size_t k = 0; k < 3; ++k) {
      store_lanes(load_lanes(lights_.irradiance[k].row(y) + x) * scale,
                  next_.irradiance[k].row(y) + x);
    }
  }
}

void Denoiser::write(int y) {
  for (int x = 0; x < width_; ++x) {
    const FilmPixel& pixel = film_.at(x, y);
    Vec3f color = pixel.seen;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = Eigen::Index(k);
      color[axis] += next_.irradiance[k].row(y)[x] * std::max(kMinAlbedo, pixel.albedo[axis]);
    }
    image_.at(x, y) = color;
  }
}

}  // namespace

Image<Vec3f> undenoised(const Film& film) {
  Image<Vec3f> image(film.width(), film.height(), Vec3f::Zero());
  for (std::size_t i = 0; i < film.pixels().size(); ++i) {
    image.pixels()[i] = film.pixels()[i].seen + film.pixels()[i].scattered;
  }
  return image;
}

Image<Vec3f> denoised(const Film& film, const Vec3f& view_position, Isa isa, Host& host) {
  return Denoiser(film, view_position, isa, host).run();
}

}  // namespace diorama
