// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "vertices.h"

namespace diorama {

/// Paths of neighbouring pixels use each other's second surfaces (Bekaert, Sbert and Halton,
/// "Accelerating path tracing by re-using paths", 2002): what came to one of these, the first
/// surfaces of all paths of its group see, too, unless something is in the way. Each of the group's
/// paths could have found it: the weights are those of the balance heuristic among them, so that
/// nothing is counted twice and nothing is left out. As many share what one found, few have to go
/// on beyond their second surface. Columns are by the numbers of a batch's paths. World space where
/// nothing else is said.
class PathReuse {
 public:
  /// Pixels whose paths use each other's: those of a batch, one sample of each.
  static constexpr std::size_t kGroup = 64;
  static constexpr std::uint32_t kSamples = std::uint32_t(kBatch / kGroup);  ///< In a batch.
  static constexpr std::uint32_t kSpacing = 8;  ///< One path of so many goes on ...
  static constexpr float kShare = 1.0f / float(kSpacing);
  /// ... as it comes, with `draw`, any bits that are the same for all samples of its pixel.
  static bool goes_on(std::uint32_t pixel, std::uint32_t sample, std::uint32_t draw) {
    return (pixel + 3 * (pixel / kSpacing) + sample + draw) % kSpacing == 0;
  }

  /// To be called before the paths of a batch begin. Samples of one pixel lie side by side.
  void clear(std::size_t paths, std::size_t samples_per_pixel);
  /// The first surface of a path, whose BSDF has no glass; the path arrives with this throughput.
  void set_first(std::size_t path, const Vertices& v, std::size_t i, const Vec3f& throughput);
  /// The second, which must have no glass either. `rival`: how many virtual lights there are
  /// there, per square metre, which bring a part of the light of lamps and sky to first surfaces.
  void set_second(std::size_t path, const Vertices& v, std::size_t i, const Vec3f& throughput,
                  float rival);
  /// The way from the second surface to a virtual light.
  void set_connection(std::size_t path, const Vec3f& local, const LayerAlbedo& albedo) {
    to_connected_.set(path, local);
    at_connected_.set(path, albedo);
  }
  /// What a path found over its second surface, with its whole throughput.
  struct Found {
    Vec3f by_light = Vec3f::Zero();   ///< Of lamps and sky, by the light sample ...
    Vec3f by_lamp = Vec3f::Zero();    ///< ... and on the way on;
    Vec3f by_way_on = Vec3f::Zero();  ///< farther on that way;
    Vec3f by_connection = Vec3f::Zero();
  };
  void set_found(std::size_t path, const Found& found) { found_[path] = found; }
  /// As so many a path's own way to a second surface counts beside virtual lights: about what the
  /// ways of its group are together.
  static constexpr float kOwnWays = float(kGroup) * kShare;

  /// Calls `give(path, light)` with what comes of all second surfaces. To ask what is in the way,
  /// `trace(ways, origin, direction, reach, seen)` gets some numbers of ways, which these columns
  /// are by, and calls `seen` with those that are free.
  template <bool kStacks, class Trace, class Give>
  void connect(Trace&& trace, Give&& give);

 private:
  struct Surfaces {
    BatchVectors position;
    BatchVectors flat_normal;
    BatchVectors normal;
    BatchVectors step;  ///< Off the surface.
    BatchLobes lobes;
    std::array<LayerTable::Row, kBatch> rows;

    void set(std::size_t path, const Vertices& v, std::size_t i);
  };

  void add_way(std::size_t first, std::size_t second);
  void find_ways();
  template <bool kStacks>
  void evaluate_seconds();
  template <bool kStacks>
  void evaluate_firsts();
  template <bool kStacks>
  void find_incoming();
  template <bool kStacks, class Trace>
  void follow_ways(Trace&& trace);

  std::size_t count_ = 0;
  std::size_t samples_ = 1;
  Surfaces firsts_;
  Surfaces seconds_;
  BatchInts has_first_;
  BatchInts has_second_;
  BatchVectors to_viewer_;  ///< Local.
  BatchAlbedos to_viewer_albedo_;
  BatchVectors throughput_first_;
  BatchVectors throughput_second_;
  BatchVectors to_light_;  ///< Local to the second surface, as the next.
  BatchVectors to_next_;
  BatchAlbedos at_light_;
  BatchAlbedos at_next_;
  BatchVectors to_connected_;
  BatchAlbedos at_connected_;
  BatchFloats rival_;
  std::array<Found, kBatch> found_;
  // The same before the second surface's BSDF.
  BatchVectors by_light_;
  BatchVectors by_lamp_;
  BatchVectors by_way_on_;
  BatchVectors by_connection_;
  BatchVectors sums_;  ///< What the first surfaces get.

  // Of ways, from first surfaces to second ones.
  std::size_t way_count_ = 0;
  BatchInts first_;
  BatchInts second_;
  BatchInts is_free_;
  BatchVectors wi_;    ///< Local to the first surface.
  BatchVectors back_;  ///< Local to the second.
  BatchFloats per_area_;
  BatchAlbedos at_first_;
  BatchAlbedos at_second_;
  BatchVectors f_light_;
  BatchVectors f_next_;
  BatchVectors f_connected_;
  BatchVectors origin_;
  BatchVectors direction_;
  BatchFloats reach_;
  BatchFloats density_;  ///< Per square metre of the second surface.
  BatchVectors brought_;
};

inline void PathReuse::clear(std::size_t paths, std::size_t samples_per_pixel) {
  count_ = paths;
  samples_ = samples_per_pixel;
  has_first_.fill(0);
  has_second_.fill(0);
}

inline void PathReuse::Surfaces::set(std::size_t path, const Vertices& v, std::size_t i) {
  position.set(path, v.position.at(i));
  flat_normal.set(path, v.flat_normal.at(i));
  normal.set(path, v.normal.at(i));
  step.set(path, v.step.at(i));
  lobes.set(path, v.bsdf[i]->lobes);
  rows[path] = v.bsdf[i]->row;
}

inline void PathReuse::set_first(std::size_t path, const Vertices& v, std::size_t i,
                                 const Vec3f& throughput) {
  has_first_[path] = 1;
  firsts_.set(path, v, i);
  to_viewer_.set(path, v.to_viewer.at(i));
  to_viewer_albedo_.set(path, v.albedo.at(i));
  throughput_first_.set(path, throughput);
}

inline void PathReuse::set_second(std::size_t path, const Vertices& v, std::size_t i,
                                  const Vec3f& throughput, float rival) {
  has_second_[path] = 1;
  rival_[path] = rival;
  to_connected_.set(path, Vec3f::UnitZ());
  at_connected_.set(path, {});
  seconds_.set(path, v, i);
  throughput_second_.set(path, throughput);
  to_light_.set(path, v.to_light.at(i));
  to_next_.set(path, v.to_next.at(i));
  at_light_.set(path, v.at_light.at(i));
  at_next_.set(path, v.at_next.at(i));
}

inline void PathReuse::add_way(std::size_t first, std::size_t second) {
  first_[way_count_] = std::int32_t(first);
  second_[way_count_] = std::int32_t(second);
  ++way_count_;
}

inline void PathReuse::find_ways() {
  for (std::size_t w = way_count_; w < whole_steps(way_count_); ++w) {
    first_[w] = first_[0];
    second_[w] = second_[0];
  }
  for (std::size_t w = 0; w < whole_steps(way_count_); ++w) {
    const auto i = std::size_t(first_[w]);
    const auto j = std::size_t(second_[w]);
    const Vec3f to = seconds_.position.at(j) - firsts_.position.at(i);
    const float distance2 = to.squaredNorm();
    const Vec3f way = to * (1.0f / std::sqrt(distance2));
    const float there = -seconds_.flat_normal.at(j).dot(way);
    wi_.set(w, basis_around(firsts_.normal.at(i)).to_local(way));
    Vec3f back = basis_around(seconds_.normal.at(j)).to_local(-way);
    back.z() = std::max(back.z(), 1e-4f);
    back_.set(w, unit(back));
    per_area_[w] = there / distance2;
    is_free_[w] = (there > 0.0f) & (wi_.z[w] > 0.0f) & (firsts_.flat_normal.at(i).dot(way) > 0.0f);
    // To where the second surface's own rays begin, too: what lies closer hides neither.
    const Vec3f from = firsts_.position.at(i) + firsts_.step.at(i);
    const Vec3f line = seconds_.position.at(j) + seconds_.step.at(j) - from;
    const float length = std::sqrt(line.squaredNorm());
    constexpr float kAlmost = 0.99999f;
    origin_.set(w, from);
    direction_.set(w, line * (1.0f / length));
    reach_[w] = kAlmost * length;
  }
  for (std::size_t w = 0; w < way_count_; ++w) {
    at_first_.set(w, albedo_at(firsts_.rows[std::size_t(first_[w])], wi_.z[w]));
    at_second_.set(w, albedo_at(seconds_.rows[std::size_t(second_[w])], back_.z[w]));
  }
}

template <bool kStacks>
inline void PathReuse::evaluate_seconds() {
  for (std::size_t w = 0; w < whole_steps(way_count_); ++w) {
    const auto j = std::size_t(second_[w]);
    const Lobes lobes(seconds_.lobes.at(j), at_second_.at(w), back_.at(w), kStacks);
    f_light_.set(w, lobes.evaluate(to_light_.at(j), at_light_.at(j)).f_cos);
    f_next_.set(w, lobes.evaluate(to_next_.at(j), at_next_.at(j)).f_cos);
    f_connected_.set(w, lobes.evaluate(to_connected_.at(j), at_connected_.at(j)).f_cos);
  }
}

template <bool kStacks>
inline void PathReuse::evaluate_firsts() {
  for (std::size_t w = 0; w < whole_steps(way_count_); ++w) {
    const auto i = std::size_t(first_[w]);
    const auto j = std::size_t(second_[w]);
    const Lobes lobes(firsts_.lobes.at(i), to_viewer_albedo_.at(i), to_viewer_.at(i), kStacks);
    const BsdfValue value = lobes.evaluate(wi_.at(w), at_first_.at(w));
    density_[w] = value.density * per_area_[w];
    is_free_[w] &= value.density > kLeastDensity;
    const Vec3f direct =
        f_light_.at(w).cwiseProduct(by_light_.at(j)) + f_next_.at(w).cwiseProduct(by_lamp_.at(j));
    const float own = kOwnWays * density_[w];
    const Vec3f light = (own / std::max(own + rival_[j], 1e-30f)) * direct +
                        f_next_.at(w).cwiseProduct(by_way_on_.at(j)) +
                        f_connected_.at(w).cwiseProduct(by_connection_.at(j));
    brought_.set(w, per_area_[w] * value.f_cos.cwiseProduct(light));
  }
}

/// What arrives at the second surfaces, from what their own paths made of it.
template <bool kStacks>
inline void PathReuse::find_incoming() {
  constexpr float kLeast = 1e-20f;
  const auto over = [kLeast](const Vec3f& light, const Vec3f& share) -> Vec3f {
    return {light.x() / std::max(share.x(), kLeast), light.y() / std::max(share.y(), kLeast),
            light.z() / std::max(share.z(), kLeast)};
  };
  way_count_ = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (has_second_[i] == 0) continue;
    // Surfaces that bring nothing are of no interest.
    const Found& f = found_[i];
    has_second_[i] = (f.by_light + f.by_lamp + f.by_way_on + f.by_connection).maxCoeff() > 0.0f;
    if (has_second_[i] != 0) add_way(i, i);
  }
  if (way_count_ == 0) return;
  find_ways();
  evaluate_seconds<kStacks>();
  for (std::size_t w = 0; w < way_count_; ++w) {
    const auto i = std::size_t(first_[w]);
    const Vec3f t = throughput_second_.at(i);
    const Found& f = found_[i];
    by_light_.set(i, over(f.by_light, t.cwiseProduct(f_light_.at(w))));
    by_lamp_.set(i, over(f.by_lamp, t.cwiseProduct(f_next_.at(w))));
    by_way_on_.set(i, over(f.by_way_on, t.cwiseProduct(f_next_.at(w))));
    by_connection_.set(i, over(f.by_connection, t.cwiseProduct(f_connected_.at(w))));
  }
}

/// Gives first surfaces what comes over the ways, all that there are from each second one.
template <bool kStacks, class Trace>
inline void PathReuse::follow_ways(Trace&& trace) {
  if (way_count_ == 0) return;
  find_ways();
  evaluate_seconds<kStacks>();
  evaluate_firsts<kStacks>();
  std::array<std::uint8_t, kBatch> asked;
  std::size_t count = 0;
  for (std::size_t w = 0; w < way_count_; ++w) {
    if (is_free_[w] == 0 || first_[w] == second_[w]) continue;
    asked[count++] = std::uint8_t(w);
    is_free_[w] = 0;
  }
  trace(asked.data(), count, origin_, direction_, reach_, [&](std::size_t w) { is_free_[w] = 1; });
  for (std::size_t begin = 0, end = 0; begin < way_count_; begin = end) {
    float all = 0.0f;
    for (end = begin; end < way_count_ && second_[end] == second_[begin]; ++end) {
      if (is_free_[end] != 0) all += density_[end];
    }
    for (std::size_t w = begin; w < end; ++w) {
      if (is_free_[w] == 0) continue;
      const auto i = std::size_t(first_[w]);
      sums_.set(i, sums_.at(i) + brought_.at(w) * (1.0f / (kShare * all)));
    }
  }
  way_count_ = 0;
}

template <bool kStacks, class Trace, class Give>
inline void PathReuse::connect(Trace&& trace, Give&& give) {
  find_incoming<kStacks>();
  way_count_ = 0;
  for (BatchFloats* sums : {&sums_.x, &sums_.y, &sums_.z}) sums->fill(0.0f);
  for (std::size_t second = 0; second < count_; ++second) {
    if (has_second_[second] == 0) continue;
    if (way_count_ + kGroup > kBatch) follow_ways<kStacks>(trace);
    const std::size_t begin = second / (kGroup * samples_) * kGroup * samples_;
    const std::size_t end = std::min(count_, begin + kGroup * samples_);
    for (std::size_t first = begin + second % samples_; first < end; first += samples_) {
      if (has_first_[first] != 0) add_way(first, second);
    }
  }
  follow_ways<kStacks>(trace);
  for (std::size_t i = 0; i < count_; ++i) {
    if (has_first_[i] != 0) give(i, throughput_first_.at(i).cwiseProduct(sums_.at(i)));
  }
}

}  // namespace diorama
