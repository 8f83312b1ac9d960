// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "path_starts.h"
#include "vertices.h"

namespace diorama {

/// Paths of pixels that are near each other (see PixelGroups) use each other's second surfaces
/// (Bekaert, Sbert and Halton, "Accelerating path tracing by re-using paths", 2002): what came to
/// one of these, the first surfaces of all paths of its group see, too, unless something is in the
/// way. Each of the group's paths could have found it: the weights are those of the balance
/// heuristic among them, so that nothing is counted twice and nothing is left out. As many share
/// what one found, few have to go on beyond their second surface. World space where nothing else is
/// said.
class PathReuse {
 public:
  /// Of each pixel in a batch, at most.
  static constexpr std::uint32_t kSamples = std::uint32_t(kBatch) / PixelGroups::kPixels;
  static constexpr float kShare = 1.0f / float(PixelGroups::kSpacing);

  /// To be called for every path of a batch before it begins, in order, from 0. `group`: see
  /// PathStart.
  void begin(std::size_t path, std::uint32_t group);
  /// The first surface of a path, whose BSDF has no glass; the path arrives with this throughput.
  void set_first(std::size_t path, const Vertices& v, std::size_t i, const Vec3f& throughput);
  /// The second, which must have no glass either. `rival`: how many virtual lights there are
  /// there, per square metre, which bring a part of the light of lamps and sky to first surfaces.
  void set_second(std::size_t path, const Vertices& v, std::size_t i, const Vec3f& throughput,
                  float rival);
  /// The way from the second surface to a virtual light.
  void set_connection(std::size_t path, const Vec3f& local, const LayerAlbedo& albedo) {
    seconds_[path].to_connected = local;
    seconds_[path].at_connected = albedo;
  }
  /// What a path found over its second surface, with its whole throughput.
  struct Found {
    Vec3f by_light = Vec3f::Zero();   ///< Of lamps and sky, by the light sample ...
    Vec3f by_lamp = Vec3f::Zero();    ///< ... and on the way on;
    Vec3f by_way_on = Vec3f::Zero();  ///< farther on that way;
    Vec3f by_connection = Vec3f::Zero();

    void scale(float times) {
      for (Vec3f* light : {&by_light, &by_lamp, &by_way_on, &by_connection}) *light *= times;
    }
    float brightest() const { return (by_light + by_lamp + by_way_on + by_connection).maxCoeff(); }
  };
  /// `chance`: evenly from [0, 1), by which second surfaces are left out that bring little.
  void set_found(std::size_t path, const Found& found, float chance) {
    seconds_[path].found = found;
    chances_[path] = chance;
  }
  /// As so many a path's own way to a second surface counts beside virtual lights: about what the
  /// ways of its group are together.
  static constexpr float kOwnWays = float(PixelGroups::kPixels) * kShare;

  /// Calls `give(path, light)` with what comes of all second surfaces. To ask what is in the way,
  /// `trace(ways, origin, direction, reach, seen)` gets some numbers of ways, which these columns
  /// are by, and calls `seen` with those that are free.
  template <bool kStacks, class Trace, class Give>
  void connect(Trace&& trace, Give&& give);

 private:
  struct Surface {
    Vec3f position;
    Vec3f flat_normal;
    Vec3f normal;
    Vec3f step;  ///< Off the surface.
    LobeWeights lobes;
    LayerTable::Row row;
    Vec3f throughput;  ///< Of the path that arrives.

    Surface() = default;
    Surface(const Vertices& v, std::size_t i, const Vec3f& arriving)
        : position(v.position.at(i)),
          flat_normal(v.flat_normal.at(i)),
          normal(v.normal.at(i)),
          step(v.step.at(i)),
          lobes(v.bsdf[i]->lobes),
          row(v.bsdf[i]->row),
          throughput(arriving) {}
  };
  struct First : Surface {
    Vec3f to_viewer;  ///< Local.
    LayerAlbedo to_viewer_albedo;
  };
  struct Second : Surface {
    Vec3f to_light;  ///< Local, as the next two.
    Vec3f to_next;
    Vec3f to_connected;
    LayerAlbedo at_light;
    LayerAlbedo at_next;
    LayerAlbedo at_connected;
    float rival = 0.0f;
    Found found;  ///< With the path's whole throughput.
  };

  void take_group(std::uint32_t group);
  void leave_out_dark();
  void find_ways(const Second& s);
  template <bool kStacks>
  void evaluate_second(const Second& s);
  template <bool kStacks>
  void evaluate_firsts(const Second& s, std::size_t own);
  template <class Trace>
  void weigh(std::size_t own, Trace&& trace);

  // By path.
  std::size_t count_ = 0;
  std::array<std::uint32_t, kBatch> group_;
  std::array<bool, kBatch> has_first_;
  std::array<bool, kBatch> has_second_;
  std::array<First, kBatch> firsts_;
  std::array<Second, kBatch> seconds_;
  std::array<float, kBatch> chances_;
  std::array<Vec3f, kBatch> sums_;  ///< What the first surfaces get.

  // By ways, from all first surfaces of a group to one second surface.
  std::size_t ways_ = 0;
  std::array<std::uint8_t, kBatch> path_;
  BatchVectors position_;
  BatchVectors flat_normal_;
  BatchVectors normal_;
  BatchVectors step_;
  BatchLobes lobes_;
  BatchVectors to_viewer_;
  BatchAlbedos to_viewer_albedo_;
  BatchInts is_free_;
  BatchVectors wi_;    ///< Local to the first surface.
  BatchVectors back_;  ///< Local to the second.
  BatchFloats per_area_;
  BatchAlbedos at_first_;
  BatchAlbedos at_second_;
  BatchLobes second_lobes_;  ///< One entry, which loops can read as vector code.
  BatchVectors f_light_;
  BatchVectors f_next_;
  BatchVectors f_connected_;
  BatchVectors origin_;
  BatchVectors direction_;
  BatchFloats reach_;
  BatchFloats density_;  ///< Per square metre of the second surface.
  BatchVectors brought_;
};

inline void PathReuse::begin(std::size_t path, std::uint32_t group) {
  count_ = path + 1;
  group_[path] = group;
  has_first_[path] = false;
  has_second_[path] = false;
}

inline void PathReuse::set_first(std::size_t path, const Vertices& v, std::size_t i,
                                 const Vec3f& throughput) {
  has_first_[path] = true;
  firsts_[path] = {{v, i, throughput}, v.to_viewer.at(i), v.albedo.at(i)};
}

inline void PathReuse::set_second(std::size_t path, const Vertices& v, std::size_t i,
                                  const Vec3f& throughput, float rival) {
  has_second_[path] = true;
  seconds_[path] = {{v, i, throughput},
                    v.to_light.at(i),
                    v.to_next.at(i),
                    Vec3f::UnitZ(),
                    v.at_light.at(i),
                    v.at_next.at(i),
                    {},
                    rival,
                    {}};
}

/// Roulette among second surfaces, by how bright they look from their own path: to ask which others
/// see one takes as long for a dark one as for a bright one. Below so many times the mean of a
/// batch, they are left out by chance. It adds little noise: for brightness b the squares of all
/// grow by sum(b * (limit - b)) < limit * sum(b), and bright ones have most of these.
inline void PathReuse::leave_out_dark() {
  constexpr float kLimit = 1.5f;
  std::array<float, kBatch> brightness{};
  float sum = 0.0f;
  float count = 0.0f;
  for (std::size_t i = 0; i < count_; ++i) {
    if (!has_second_[i]) continue;
    const Second& s = seconds_[i];
    constexpr float kLeast = 1e-20f;
    brightness[i] = s.found.brightest() / std::max(s.throughput.maxCoeff(), kLeast);
    sum += brightness[i];
    count += 1.0f;
  }
  if (!(sum > 0.0f)) return;
  const float limit = kLimit * sum / count;
  for (std::size_t i = 0; i < count_; ++i) {
    if (!has_second_[i] || brightness[i] >= limit) continue;
    has_second_[i] = chances_[i] * limit < brightness[i];
    if (has_second_[i]) seconds_[i].found.scale(limit / brightness[i]);
  }
}

/// The ways' first surfaces.
inline void PathReuse::take_group(std::uint32_t group) {
  ways_ = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (group_[i] != group || !has_first_[i]) continue;
    const First& f = firsts_[i];
    path_[ways_] = std::uint8_t(i);
    position_.set(ways_, f.position);
    flat_normal_.set(ways_, f.flat_normal);
    normal_.set(ways_, f.normal);
    step_.set(ways_, f.step);
    lobes_.set(ways_, f.lobes);
    to_viewer_.set(ways_, f.to_viewer);
    to_viewer_albedo_.set(ways_, f.to_viewer_albedo);
    ++ways_;
  }
}

inline void PathReuse::find_ways(const Second& s) {
  const Basis basis = basis_around(s.normal);
  const Vec3f end = s.position + s.step;
  for (std::size_t w = 0; w < whole_steps(ways_); ++w) {
    const Vec3f to = s.position - position_.at(w);
    const float distance2 = to.squaredNorm();
    const Vec3f way = to * (1.0f / std::sqrt(distance2));
    const float there = -s.flat_normal.dot(way);
    wi_.set(w, basis_around(normal_.at(w)).to_local(way));
    Vec3f back = basis.to_local(-way);
    back.z() = std::max(back.z(), 1e-4f);
    back_.set(w, unit(back));
    per_area_[w] = there / distance2;
    is_free_[w] = (there > 0.0f) & (wi_.z[w] > 0.0f) & (flat_normal_.at(w).dot(way) > 0.0f);
    // To where the second surface's own rays begin, too: what lies closer hides neither.
    const Vec3f from = position_.at(w) + step_.at(w);
    const Vec3f line = end - from;
    const float length = std::sqrt(line.squaredNorm());
    constexpr float kAlmost = 0.99999f;
    origin_.set(w, from);
    direction_.set(w, line * (1.0f / length));
    reach_[w] = kAlmost * length;
  }
  for (std::size_t w = 0; w < ways_; ++w) {
    at_first_.set(w, albedo_at(firsts_[path_[w]].row, wi_.z[w]));
    at_second_.set(w, albedo_at(s.row, back_.z[w]));
  }
}

template <bool kStacks>
inline void PathReuse::evaluate_second(const Second& s) {
  const bool is_connected = s.found.by_connection.maxCoeff() > 0.0f;
  second_lobes_.set(0, s.lobes);
  for (std::size_t w = 0; w < whole_steps(ways_); ++w) {
    const Lobes lobes(second_lobes_.at(0), at_second_.at(w), back_.at(w), kStacks);
    f_light_.set(w, lobes.evaluate(s.to_light, s.at_light).f_cos);
    f_next_.set(w, lobes.evaluate(s.to_next, s.at_next).f_cos);
  }
  if (!is_connected) {
    for (BatchFloats* f : {&f_connected_.x, &f_connected_.y, &f_connected_.z}) f->fill(0.0f);
    return;
  }
  for (std::size_t w = 0; w < whole_steps(ways_); ++w) {
    const Lobes lobes(second_lobes_.at(0), at_second_.at(w), back_.at(w), kStacks);
    f_connected_.set(w, lobes.evaluate(s.to_connected, s.at_connected).f_cos);
  }
}

/// `own`: the way that the second surface was found by.
template <bool kStacks>
inline void PathReuse::evaluate_firsts(const Second& s, std::size_t own) {
  // What arrives there, by what its own path made of it.
  const auto arriving = [&](const Vec3f& light, const Vec3f& f) -> Vec3f {
    constexpr float kLeast = 1e-20f;
    return light.cwiseQuotient(s.throughput.cwiseProduct(f).cwiseMax(kLeast));
  };
  const Vec3f by_light = arriving(s.found.by_light, f_light_.at(own));
  const Vec3f by_lamp = arriving(s.found.by_lamp, f_next_.at(own));
  const Vec3f by_way_on = arriving(s.found.by_way_on, f_next_.at(own));
  const Vec3f by_connection = arriving(s.found.by_connection, f_connected_.at(own));
  for (std::size_t w = 0; w < whole_steps(ways_); ++w) {
    const Lobes lobes(lobes_.at(w), to_viewer_albedo_.at(w), to_viewer_.at(w), kStacks);
    const BsdfValue value = lobes.evaluate(wi_.at(w), at_first_.at(w));
    density_[w] = value.density * per_area_[w];
    is_free_[w] &= value.density > kLeastDensity;
    const Vec3f direct =
        f_light_.at(w).cwiseProduct(by_light) + f_next_.at(w).cwiseProduct(by_lamp);
    const float all_own = kOwnWays * density_[w];
    const Vec3f light = (all_own / std::max(all_own + s.rival, 1e-30f)) * direct +
                        f_next_.at(w).cwiseProduct(by_way_on) +
                        f_connected_.at(w).cwiseProduct(by_connection);
    brought_.set(w, per_area_[w] * value.f_cos.cwiseProduct(light));
  }
}

template <class Trace>
inline void PathReuse::weigh(std::size_t own, Trace&& trace) {
  std::array<std::uint8_t, kBatch> asked;
  std::size_t count = 0;
  for (std::size_t w = 0; w < ways_; ++w) {
    if (is_free_[w] == 0 || w == own) continue;
    asked[count++] = std::uint8_t(w);
    is_free_[w] = 0;
  }
  trace(asked.data(), count, origin_, direction_, reach_, [&](std::size_t w) { is_free_[w] = 1; });
  float all = 0.0f;
  for (std::size_t w = 0; w < ways_; ++w) {
    if (is_free_[w] != 0) all += density_[w];
  }
  for (std::size_t w = 0; w < ways_; ++w) {
    if (is_free_[w] != 0) sums_[path_[w]] += brought_.at(w) * (1.0f / (kShare * all));
  }
}

template <bool kStacks, class Trace, class Give>
inline void PathReuse::connect(Trace&& trace, Give&& give) {
  if (count_ == 0) return;
  std::fill_n(sums_.begin(), count_, Vec3f::Zero());
  leave_out_dark();
  for (std::uint32_t group = group_[0]; group <= group_[count_ - 1]; ++group) {
    take_group(group);
    for (std::size_t own = 0; own < ways_; ++own) {
      if (!has_second_[path_[own]]) continue;
      const Second s = seconds_[path_[own]];  // A copy: it overlaps with no column.
      // Most bring nothing, and nobody looks at them.
      if (!(s.found.brightest() > 0.0f)) continue;
      find_ways(s);
      evaluate_second<kStacks>(s);
      evaluate_firsts<kStacks>(s, own);
      weigh(own, trace);
    }
  }
  for (std::size_t i = 0; i < count_; ++i) {
    if (has_first_[i]) give(i, firsts_[i].throughput.cwiseProduct(sums_[i]));
  }
}

}  // namespace diorama
