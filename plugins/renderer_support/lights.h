// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "batch.h"
#include "diorama/light.h"
#include "dome.h"
#include "light_tree.h"
#include "sampling.h"
#include "sky_grid.h"

namespace diorama {

/// The triangles of one emitting material of one mesh in the scene, in world space.
struct EmittingTriangles {
  struct Triangle {
    Vec3f a, ab, ac;          ///< Corner and edges.
    std::uint32_t index = 0;  ///< In its mesh.

    std::array<Vec3f, 3> corners() const { return {a, a + ab, a + ac}; }
    /// Out of the front (see is_mirrored below), twice as long as the area is large.
    Vec3f front(bool is_mirrored) const { return ab.cross(ac) * (is_mirrored ? -1.0f : 1.0f); }
  };
  std::vector<Triangle> triangles;
  std::uint32_t geometry = 0;
  bool is_double_sided = true;
  /// Of a double-sided lamp: its inner side is hardly seen from anywhere.
  bool is_closed = false;
  bool is_mirrored = false;  ///< The front, or outside, is where the corners run clockwise.
  Vec3f mean_radiance = Vec3f::Zero();
};

/// Where a light, or a texture on it, is sampled.
struct LightPlace {
  std::uint32_t light = 0;
  std::uint32_t triangle = 0;   ///< Of emitting triangles, in their mesh.
  Vec2f place = Vec2f::Zero();  ///< In a dome's image, or barycentric in the triangle.
};

/// All that emits. A light is chosen in proportion to its unshadowed contribution (estimated), so
/// that one shadow ray per vertex goes where it matters. Filled by add(), made ready by finish().
/// What render kernels call is inline: it is compiled into each of them.
class Lights {
  enum class Shape : std::uint8_t { Sphere, TurningDisk, Rect, Disk, Distant, Dome, Triangles };
  static constexpr std::size_t kShapes = 7;
  struct Record {
    Shape shape = Shape::Sphere;
    Vec3f position = Vec3f::Zero();
    Vec3f axis_x = Vec3f::UnitX();  ///< Half extents of rect and disk.
    Vec3f axis_y = Vec3f::UnitY();
    Vec3f direction = -Vec3f::UnitZ();  ///< Unit, that it shines along.
    float radius = 0.0f;                ///< Of the sphere, or of a sphere around the body.
    float area = 0.0f;
    Vec3f radiance = Vec3f::Zero();  ///< Irradiance for a distant light of zero size.
    float spread = 2.0f;             ///< See LightTree.
    float depth = 0.0f;
    float behind = 0.0f;
    float power = 0.0f;          ///< Luminous weight in scores.
    float one_minus_cos = 0.0f;  ///< Distant: of its angular radius.
    float cos_outer = -2.0f;     ///< Cone; below -1: none.
    float cos_inner = -2.0f;
    bool is_double_sided = true;
    bool is_mirrored = false;
    bool is_visible_to_camera = true;
    Eigen::Matrix3f dome_from_world = Eigen::Matrix3f::Identity();
    std::shared_ptr<const DomeTexture> texture;
    std::shared_ptr<const SkyGrid> sky;
    std::uint32_t geometry = 0;
    std::vector<EmittingTriangles::Triangle> triangles;
    std::vector<float> cumulative_area;
  };

  /// What draws read of the lights, by their numbers: for loops over places, each with its light.
  struct Columns {
    using Vectors = std::array<std::vector<float>, 3>;
    std::vector<std::int32_t> shape;
    Vectors position, axis_x, axis_y, direction;
    std::vector<float> radius, area, one_minus_cos;
    void add(const Record& light);
  };
  /// The lights of a batch of places, and where on them; see Record.
  struct Asked {
    BatchVectors to_light;  ///< To its position.
    BatchFloats radius, area, one_minus_cos;
    BatchVectors axis_x, axis_y, shines_along;
    BatchFloats u, v;
  };

 public:
  /// `has_disk_lamps`: spheres shine like disks that turn to every point they light, as in Cycles;
  /// points closer than a few radii get less light from them than from a sphere.
  explicit Lights(bool has_disk_lamps = false) : has_disk_lamps_(has_disk_lamps) {}

  /// `texture`: of a dome; one without an image has a white one.
  void add(const Light& light, const Affine& world_from_node,
           std::shared_ptr<const DomeTexture> texture);
  /// Returns the light's number; triangles without area are dropped.
  std::uint32_t add(EmittingTriangles triangles);

  /// Builds the tables for choosing and drawing; call after the last add().
  void finish();
  /// Which parts of a dome can be seen from where; null: all from everywhere.
  using GridOf = std::function<std::shared_ptr<const SkyGrid>(
      const std::shared_ptr<const DomeTexture>&, const Eigen::Matrix3f& world_from_dome)>;
  void learn_sky(const GridOf& grid_of);

  bool is_empty() const { return lights_.empty(); }
  std::size_t count() const { return lights_.size(); }

  /// Places of a batch that want a light each, by numbers u in [0, 1).
  struct Wishes {
    std::size_t count = 0;
    BatchVectors position;
    BatchVectors normal;
    BatchInts is_two_sided{};
    BatchFloats u{};

    Receiver receiver(std::size_t i) const {
      return {position.at(i), normal.at(i), is_two_sided[i] != 0, 0.0f};
    }
  };
  struct Choices {
    BatchInts light{};
    BatchFloats probability{};        ///< Zero: no light can contribute.
    BatchFloats total_score{};        ///< For Receiver.
    std::vector<BatchFloats> scores;  ///< Of the entries that are compared.
  };
  void choose(const Wishes& wishes, Choices& choices) const;
  /// Probability with which choose() picks this light for the receiver.
  float probability(std::uint32_t light, const Receiver& receiver) const;

  /// Points of the lights chosen for a batch of places.
  struct Samples {
    BatchVectors direction;  ///< Unit, from the place.
    BatchFloats distance{};  ///< Infinite for dome and distant lights.
    /// Per solid angle, without the choice of the light. Zero: nothing arrives. Infinite: the
    /// light's radiance is an irradiance, and no other technique can find it.
    BatchFloats density{};
    BatchInts light{};
    BatchInts triangle{};
    BatchFloats place_x{}, place_y{};

    LightPlace place(std::size_t i) const {
      return {std::uint32_t(light[i]), std::uint32_t(triangle[i]), {place_x[i], place_y[i]}};
    }
  };
  /// `u`, `v` in [0, 1) place the samples.
  void sample(const Wishes& wishes, const Choices& choices, const BatchFloats& u,
              const BatchFloats& v, Samples& samples) const;
  /// The radiance of a sample that leaves along `direction` (unit, from the receiver). Apart from
  /// sample() because a dome's image is large: it is read only when the sample turns out to be lit.
  Vec3f radiance_of(const LightPlace& place, const Vec3f& direction) const;
  /// Whether the sample lies on a mesh, whose material knows the radiance.
  bool is_surface(const LightPlace& place) const {
    return lights_[place.light].shape == Shape::Triangles;
  }
  std::uint32_t geometry_of(const LightPlace& place) const { return lights_[place.light].geometry; }
  /// Density per solid angle of an emitting triangle's point, seen from `from`.
  float density_of_surface(std::uint32_t light, float distance, float cos_at_light) const;

  /// Sets `may_meet` for rays that pass through a sphere around a light without a mesh that has a
  /// place; other rays need not ask along_ray() but for dome and distant lights.
  void find_near(std::size_t count, const BatchVectors& origin, const BatchVectors& direction,
                 BatchInts& may_meet) const;
  /// What a ray meets of lights without a mesh, from t_min to t_max, and of dome and distant lights
  /// when t_max is infinite. Calls found(light, radiance, density) for each; the density is that of
  /// sample() from `from`, the start of the ray: for one that went straight through panes, the
  /// place that took the light sample, with t_min at the last pane.
  template <class Found>
  void along_ray(const Vec3f& from, const Vec3f& direction, float t_min, float t_max,
                 bool is_camera_ray, Found&& found) const;

 private:
  /// The entry that each place of a batch has come to among those offered so far.
  struct Picks {
    BatchInts entry;  ///< -1: none.
    BatchFloats score{};
    BatchFloats before{};  ///< Sum of the scores of the entries before it ...
    BatchFloats end{};     ///< ... and with its own.
    Picks() { entry.fill(-1); }
    void offer(int index, const BatchFloats& scores, const BatchFloats& u, const BatchFloats& total,
               std::size_t size);
  };

  static bool is_body(const Record& light) {
    return light.shape != Shape::Distant && light.shape != Shape::Dome;
  }
  /// Of triangles that shine on one side only, or nearly so, and face similar ways.
  static void find_direction(Record& light);
  static bool is_near(const Record& light, const Vec3f& from, const Vec3f& direction);
  static float score_of_distant(const Record& light, const Vec3f& normal, bool is_two_sided);
  static float score_of_surroundings(const Record& light, const Receiver& receiver);
  static void score_surroundings(const Record& light, const Wishes& wishes, BatchFloats& scores);
  static float cone_factor(const Record& light, const Vec3f& from_light);
  /// Returns the density; zero: not met.
  static float meet(const Record& light, const Vec3f& from, const Vec3f& direction, float t_min,
                    float t_max, Vec3f& radiance);
  static float meet_sphere(const Record& light, const Vec3f& from, const Vec3f& direction,
                           float t_min, float t_max, Vec3f& radiance);
  static float meet_turning_disk(const Record& light, const Vec3f& from, const Vec3f& direction,
                                 float t_min, float t_max, Vec3f& radiance);
  static float meet_flat(const Record& light, const Vec3f& from, const Vec3f& direction,
                         float t_min, float t_max, Vec3f& radiance);
  struct Draw {
    Vec3f direction;
    float distance = 0.0f;
    float density = 0.0f;
  };
  void descend(const Wishes& wishes, const Picks& picks, Choices& choices) const;
  void draw(Shape shape, const Wishes& wishes, const BatchFloats& u, const BatchFloats& v,
            Samples& samples) const;
  template <class DrawOne>
  void draw_all(Shape shape, const Wishes& wishes, const BatchFloats& u, const BatchFloats& v,
                Samples& samples, DrawOne&& draw_one) const;
  static void look_up(const Columns::Vectors& columns, const BatchInts& lights, std::size_t size,
                      BatchVectors& values);
  void look_up(Shape shape, const BatchInts& lights, std::size_t size, Asked& asked) const;
  static Draw draw_sphere(const Asked& asked, std::size_t i);
  static Draw draw_turning_disk(const Asked& asked, std::size_t i);
  static Draw draw_flat(const Asked& asked, std::size_t i, bool is_disk);
  static Draw draw_distant(const Asked& asked, std::size_t i);
  void draw_dome(std::uint32_t number, const Wishes& wishes, const BatchFloats& u,
                 const BatchFloats& v, Samples& samples) const;
  void draw_triangles(const Wishes& wishes, const BatchFloats& u, const BatchFloats& v,
                      Samples& samples) const;

  bool has_disk_lamps_;
  std::vector<Record> lights_;
  std::vector<std::uint32_t> shapes_;        ///< Sphere, rect, disk: rays meet them here.
  std::vector<std::uint32_t> bodies_;        ///< All with a place, in the order of the tree.
  std::vector<std::uint32_t> surroundings_;  ///< Distant, dome.
  std::vector<std::uint32_t> order_;         ///< Per light: its number in bodies_.
  LightTree tree_;
  Columns columns_;
  /// The light of each entry that choose() compares; -1: a group of the tree.
  std::vector<std::int32_t> entry_lights_;
};

// One minus the cosine of the half angle under which a sphere of this squared sine is seen, without
// cancellation.
inline float one_minus_cos_of(float sin2) {
  return sin2 / (1.0f + std::sqrt(std::max(0.0f, 1.0f - sin2)));
}

inline bool Lights::is_near(const Record& light, const Vec3f& from, const Vec3f& direction) {
  const Vec3f to = light.position - from;
  const float along = to.dot(direction);
  const float off2 = (to - along * direction).squaredNorm();
  return (off2 < light.radius * light.radius) & (along + light.radius > 0.0f);
}

inline void Lights::find_near(std::size_t count, const BatchVectors& origin,
                              const BatchVectors& direction, BatchInts& may_meet) const {
  may_meet.fill(0);
  for (const std::uint32_t index : shapes_) {
    const Record& light = lights_[index];
    for (std::size_t i = 0; i < whole_steps(count); ++i) {
      may_meet[i] |= std::int32_t(is_near(light, origin.at(i), direction.at(i)));
    }
  }
}

template <class Found>
void Lights::along_ray(const Vec3f& from, const Vec3f& direction, float t_min, float t_max,
                       bool is_camera_ray, Found&& found) const {
  const auto report = [&](std::uint32_t index) {
    const Record& light = lights_[index];
    if (is_camera_ray && !light.is_visible_to_camera) return;
    Vec3f radiance = Vec3f::Zero();
    const float density = meet(light, from, direction, t_min, t_max, radiance);
    if (density > 0.0f) found(index, radiance, density);
  };
  for (const std::uint32_t index : shapes_) {
    if (is_near(lights_[index], from, direction)) report(index);
  }
  if (t_max == kInfinite) {
    for (const std::uint32_t index : surroundings_) report(index);
  }
}

inline float Lights::score_of_distant(const Record& light, const Vec3f& normal, bool is_two_sided) {
  constexpr float kFloor = 0.1f;
  const float reach = std::sqrt(light.one_minus_cos * (2.0f - light.one_minus_cos)) + 1e-3f;
  const float facing = -normal.dot(light.direction);
  const float cosine = reach + (is_two_sided ? std::abs(facing) : facing);
  return cosine > 0.0f ? light.power * std::max(kFloor, std::min(1.0f, cosine)) : 0.0f;
}

inline float Lights::score_of_surroundings(const Record& light, const Receiver& receiver) {
  if (light.shape == Shape::Distant) {
    return score_of_distant(light, receiver.normal, receiver.is_two_sided);
  }
  return light.power * light.sky->power(light.sky->cell(receiver.position));
}

/// The same for the places of a batch.
inline void Lights::score_surroundings(const Record& light, const Wishes& wishes,
                                       BatchFloats& scores) {
  const std::size_t size = whole_steps(wishes.count);
  if (light.shape == Shape::Distant) {
    for (std::size_t i = 0; i < size; ++i) {
      scores[i] = score_of_distant(light, wishes.normal.at(i), wishes.is_two_sided[i] != 0);
    }
    return;
  }
  BatchInts cells;
  light.sky->find_cells(wishes.position, size, cells);
  light.sky->find_powers(cells, size, scores);
  const float power = light.power;
  for (std::size_t i = 0; i < size; ++i) scores[i] *= power;
}

// Scores first, then the light in whose share of their sum a place's number falls.
inline void Lights::choose(const Wishes& wishes, Choices& choices) const {
  const std::size_t size = whole_steps(wishes.count);
  const std::uint32_t roots = tree_.root_count();
  choices.scores.resize(entry_lights_.size());
  choices.total_score.fill(0.0f);
  for (std::uint32_t entry = 0; entry < choices.scores.size(); ++entry) {
    BatchFloats& scores = choices.scores[entry];
    if (entry < roots) {
      for (std::size_t i = 0; i < size; ++i) {
        scores[i] = tree_.root_score(entry, wishes.receiver(i));
      }
    } else {
      score_surroundings(lights_[surroundings_[entry - roots]], wishes, scores);
    }
    for (std::size_t i = 0; i < size; ++i) choices.total_score[i] += scores[i];
  }
  Picks picks;
  for (std::size_t entry = 0; entry < choices.scores.size(); ++entry) {
    picks.offer(int(entry), choices.scores[entry], wishes.u, choices.total_score, size);
  }
  choices.light.fill(0);
  choices.probability.fill(0.0f);
  if (entry_lights_.empty()) return;
  BatchInts picked;
  for (std::size_t i = 0; i < size; ++i) picked[i] = std::max(picks.entry[i], 0);
  gather(entry_lights_, picked, size, picked);
  for (std::size_t i = 0; i < size; ++i) {
    const float share = picks.score[i] / choices.total_score[i];
    const bool is_none = picks.entry[i] < 0;
    choices.light[i] = is_none ? 0 : picked[i];
    choices.probability[i] = is_none ? 0.0f : share;
  }
  if (tree_.has_groups()) descend(wishes, picks, choices);
}

/// Where a group was picked, one of its lights.
[[gnu::noinline]] inline void Lights::descend(const Wishes& wishes, const Picks& picks,
                                              Choices& choices) const {
  for (std::size_t i = 0; i < wishes.count; ++i) {
    if (choices.light[i] >= 0) continue;
    const float rest = (wishes.u[i] * choices.total_score[i] - picks.before[i]) / picks.score[i];
    const LightTree::Choice within = tree_.choose(std::uint32_t(picks.entry[i]), wishes.receiver(i),
                                                  std::clamp(rest, 0.0f, 0.9999999f));
    choices.light[i] = std::int32_t(bodies_[within.light]);
    choices.probability[i] *= within.probability;
  }
  // Loops over whole steps look up lights behind the last place, too.
  std::fill(choices.light.begin() + std::ptrdiff_t(wishes.count), choices.light.end(), 0);
}

// Rounding may leave a number beyond the last share: then the last is taken.
inline void Lights::Picks::offer(int index, const BatchFloats& scores, const BatchFloats& u,
                                 const BatchFloats& total, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    const bool is_open = u[i] * total[i] >= end[i] && scores[i] > 0.0f;
    entry[i] = is_open ? index : entry[i];
    score[i] = is_open ? scores[i] : score[i];
    before[i] = is_open ? end[i] : before[i];
    end[i] = is_open ? end[i] + scores[i] : end[i];
  }
}

inline float Lights::probability(std::uint32_t light, const Receiver& receiver) const {
  const float total = receiver.total_score;
  if (!(total > 0.0f)) return 0.0f;
  const Record& record = lights_[light];
  if (!is_body(record)) return score_of_surroundings(record, receiver) / total;
  float tree_score = 0.0f;
  const float within = tree_.probability(order_[light], receiver, tree_score);
  return within * (tree_score / total);
}

inline float Lights::cone_factor(const Record& light, const Vec3f& from_light) {
  if (light.cos_outer < -1.0f) return 1.0f;
  const float c = from_light.dot(light.direction);
  const float t =
      std::clamp((c - light.cos_outer) / (light.cos_inner - light.cos_outer), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

inline Vec3f Lights::radiance_of(const LightPlace& place, const Vec3f& direction) const {
  const Record& light = lights_[place.light];
  if (light.shape != Shape::Dome) return light.radiance * cone_factor(light, -direction);
  return light.radiance.cwiseProduct(light.texture->radiance_at(place.place));
}

inline void Lights::sample(const Wishes& wishes, const Choices& choices, const BatchFloats& u,
                           const BatchFloats& v, Samples& samples) const {
  const std::size_t size = whole_steps(wishes.count);
  samples.light = choices.light;
  std::fill_n(samples.density.begin(), size, 0.0f);
  if (lights_.empty()) return;
  const std::int32_t* shapes = columns_.shape.data();
  std::uint32_t present = 0;
  for (std::size_t i = 0; i < wishes.count; ++i) {
    const std::uint32_t own = 1u << shapes[samples.light[i]];
    present |= choices.probability[i] > 0.0f ? own : 0u;
  }
  for (std::uint32_t shape = 0; shape < kShapes; ++shape) {
    if ((present >> shape & 1u) != 0) draw(Shape(shape), wishes, u, v, samples);
  }
  for (std::size_t i = 0; i < size; ++i) {
    samples.density[i] = choices.probability[i] > 0.0f ? samples.density[i] : 0.0f;
  }
}

inline void Lights::draw(Shape shape, const Wishes& wishes, const BatchFloats& u,
                         const BatchFloats& v, Samples& samples) const {
  switch (shape) {
    case Shape::Sphere:
      return draw_all(shape, wishes, u, v, samples, draw_sphere);
    case Shape::TurningDisk:
      return draw_all(shape, wishes, u, v, samples, draw_turning_disk);
    case Shape::Rect:
      return draw_all(shape, wishes, u, v, samples,
                      [](const Asked& asked, std::size_t i) { return draw_flat(asked, i, false); });
    case Shape::Disk:
      return draw_all(shape, wishes, u, v, samples,
                      [](const Asked& asked, std::size_t i) { return draw_flat(asked, i, true); });
    case Shape::Distant:
      return draw_all(shape, wishes, u, v, samples, draw_distant);
    case Shape::Dome:
      for (const std::uint32_t number : surroundings_) {
        if (lights_[number].shape == shape) draw_dome(number, wishes, u, v, samples);
      }
      return;
    case Shape::Triangles:
      return draw_triangles(wishes, u, v, samples);
  }
}

/// For all places, as if each had a light of this shape; kept for those that have.
template <class DrawOne>
inline void Lights::draw_all(Shape shape, const Wishes& wishes, const BatchFloats& u,
                             const BatchFloats& v, Samples& samples, DrawOne&& draw_one) const {
  const std::size_t size = whole_steps(wishes.count);
  Asked asked;
  look_up(shape, samples.light, size, asked);
  for (std::size_t i = 0; i < size; ++i) {
    asked.to_light.set(i, asked.to_light.at(i) - wishes.position.at(i));
    asked.u[i] = u[i];
    asked.v[i] = v[i];
  }
  BatchVectors directions;
  BatchFloats distances;
  BatchFloats densities;
  for (std::size_t i = 0; i < size; ++i) {
    const Draw draw = draw_one(asked, i);
    directions.set(i, draw.direction);
    distances[i] = draw.distance;
    densities[i] = draw.density;
  }
  BatchInts shapes;
  gather(columns_.shape, samples.light, size, shapes);
  for (std::size_t i = 0; i < size; ++i) {
    const bool is_own = shapes[i] == std::int32_t(shape);
    samples.direction.set(i, select(is_own, directions.at(i), samples.direction.at(i)));
    samples.distance[i] = select(is_own, distances[i], samples.distance[i]);
    samples.density[i] = select(is_own, densities[i], samples.density[i]);
  }
}

inline void Lights::look_up(const Columns::Vectors& columns, const BatchInts& lights,
                            std::size_t size, BatchVectors& values) {
  gather(columns[0], lights, size, values.x);
  gather(columns[1], lights, size, values.y);
  gather(columns[2], lights, size, values.z);
}

inline void Lights::look_up(Shape shape, const BatchInts& lights, std::size_t size,
                            Asked& asked) const {
  look_up(columns_.position, lights, size, asked.to_light);
  gather(columns_.radius, lights, size, asked.radius);
  gather(columns_.area, lights, size, asked.area);
  if (shape == Shape::Sphere || shape == Shape::TurningDisk) return;
  gather(columns_.one_minus_cos, lights, size, asked.one_minus_cos);
  look_up(columns_.axis_x, lights, size, asked.axis_x);
  look_up(columns_.axis_y, lights, size, asked.axis_y);
  look_up(columns_.direction, lights, size, asked.shines_along);
}

inline Lights::Draw Lights::draw_sphere(const Asked& asked, std::size_t i) {
  const Vec3f to_centre = asked.to_light.at(i);
  const float radius2 = asked.radius[i] * asked.radius[i];
  const float distance2 = to_centre.squaredNorm();
  const float sin2 = radius2 / distance2;
  const float distance = std::sqrt(distance2);
  const float one_minus_cos = one_minus_cos_of(sin2);
  const Vec3f local = uniform_cone({asked.u[i], asked.v[i]}, one_minus_cos);
  const Vec3f direction = unit(basis_around(to_centre * (1.0f / distance)).to_world(local));
  const float sine2 = std::max(0.0f, 1.0f - local.z() * local.z());
  const float within = std::sqrt(std::max(0.0f, radius2 - distance2 * sine2));
  const float density = 1.0f / (2.0f * kPiF * one_minus_cos);
  return {direction, distance * local.z() - within, sin2 < 1.0f ? density : 0.0f};
}

inline Lights::Draw Lights::draw_turning_disk(const Asked& asked, std::size_t i) {
  const Vec3f to_centre = asked.to_light.at(i);
  const float height2 = to_centre.squaredNorm();
  const Basis basis = basis_around(unit(to_centre));
  const Vec2f p = disk_from_square({asked.u[i], asked.v[i]}) * asked.radius[i];
  const Vec3f to_light = to_centre + p.x() * basis.x + p.y() * basis.y;
  const float distance2 = to_light.squaredNorm();
  const float distance = std::sqrt(distance2);
  const float density = distance2 * distance / (std::sqrt(height2) * asked.area[i]);
  const bool is_outside = height2 > asked.radius[i] * asked.radius[i];
  return {to_light * (1.0f / distance), distance, is_outside ? density : 0.0f};
}

inline Lights::Draw Lights::draw_flat(const Asked& asked, std::size_t i, bool is_disk) {
  const Vec2f u(asked.u[i], asked.v[i]);
  const Vec2f p = is_disk ? disk_from_square(u) : Vec2f(2.0f * u.x() - 1.0f, 2.0f * u.y() - 1.0f);
  const Vec3f to_light =
      asked.to_light.at(i) + p.x() * asked.axis_x.at(i) + p.y() * asked.axis_y.at(i);
  const float distance2 = to_light.squaredNorm();
  const float distance = std::sqrt(distance2);
  const Vec3f direction = to_light * (1.0f / distance);
  const float cosine = -direction.dot(asked.shines_along.at(i));
  const float density = distance2 / (cosine * asked.area[i]);
  return {direction, distance, cosine > 1e-6f ? density : 0.0f};
}

inline Lights::Draw Lights::draw_distant(const Asked& asked, std::size_t i) {
  const Vec3f towards = -asked.shines_along.at(i);
  const float one_minus_cos = asked.one_minus_cos[i];
  const Vec3f local = uniform_cone({asked.u[i], asked.v[i]}, one_minus_cos);
  const Vec3f direction = unit(basis_around(towards).to_world(local));
  const float density = 1.0f / (2.0f * kPiF * one_minus_cos);
  const bool has_size = one_minus_cos > 0.0f;
  return {select(has_size, direction, towards), kInfinite, has_size ? density : kInfinite};
}

inline void Lights::draw_dome(std::uint32_t number, const Wishes& wishes, const BatchFloats& u,
                              const BatchFloats& v, Samples& samples) const {
  const Record& light = lights_[number];
  std::array<std::uint8_t, kBatch> index;
  BatchVectors from;
  std::size_t count = 0;
  for (std::size_t i = 0; i < wishes.count; ++i) {
    index[count] = std::uint8_t(i);
    from.set(count, wishes.position.at(i));
    count += samples.light[i] == std::int32_t(number) ? 1 : 0;
  }
  const std::size_t size = whole_steps(count);
  BatchInts cells;
  light.sky->find_cells(from, size, cells);
  BatchFloats x;
  BatchFloats y;
  BatchFloats density;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = index[k];
    const SkyGrid::Choice choice = light.sky->choose(std::uint32_t(cells[k]), u[i]);
    const DomeTexture::Draw draw = light.texture->sample(choice.patch, {choice.rest, v[i]});
    x[k] = draw.place.x();
    y[k] = draw.place.y();
    density[k] = draw.density * choice.probability;
    light.texture->prefetch(draw.place);
  }
  const Basis axes{light.dome_from_world.row(0), light.dome_from_world.row(1),
                   light.dome_from_world.row(2)};
  BatchVectors directions;
  for (std::size_t k = 0; k < size; ++k) {
    const DomeTexture::Towards towards = DomeTexture::towards({x[k], y[k]});
    directions.set(k, unit(axes.to_world(towards.direction)));
    density[k] *= towards.per_solid_angle;
  }
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = index[k];
    samples.direction.set(i, directions.at(k));
    samples.distance[i] = kInfinite;
    samples.density[i] = density[k];
    samples.place_x[i] = x[k];
    samples.place_y[i] = y[k];
  }
}

[[gnu::noinline]] inline void Lights::draw_triangles(const Wishes& wishes, const BatchFloats& u,
                                                     const BatchFloats& v, Samples& samples) const {
  for (std::size_t i = 0; i < wishes.count; ++i) {
    const Record& light = lights_[std::uint32_t(samples.light[i])];
    if (light.triangles.empty()) continue;
    const float target = u[i] * light.area;
    const auto it =
        std::upper_bound(light.cumulative_area.begin(), light.cumulative_area.end() - 1, target);
    const auto index = std::size_t(it - light.cumulative_area.begin());
    const float before = index == 0 ? 0.0f : light.cumulative_area[index - 1];
    const float size = light.cumulative_area[index] - before;
    const float again = size > 0.0f ? std::clamp((target - before) / size, 0.0f, 0.999999f) : 0.5f;
    const EmittingTriangles::Triangle& t = light.triangles[index];
    const Vec2f weights = triangle_from_square({again, v[i]});
    const Vec3f to_light = t.a + weights.x() * t.ab + weights.y() * t.ac - wishes.position.at(i);
    const float distance2 = to_light.squaredNorm();
    const float distance = std::sqrt(distance2);
    const Vec3f direction = to_light / distance;
    const float cosine = -direction.dot(t.ab.cross(t.ac).normalized());
    const bool is_front = (cosine < 0.0f) == light.is_mirrored;
    if (!(std::abs(cosine) > 1e-6f) || !(is_front || light.is_double_sided)) continue;
    samples.direction.set(i, direction);
    samples.distance[i] = distance;
    samples.density[i] = distance2 / (std::abs(cosine) * light.area);
    samples.triangle[i] = std::int32_t(t.index);
    samples.place_x[i] = weights.x();
    samples.place_y[i] = weights.y();
  }
}

inline float Lights::density_of_surface(std::uint32_t light, float distance,
                                        float cos_at_light) const {
  return distance * distance / (std::max(1e-6f, std::abs(cos_at_light)) * lights_[light].area);
}

[[gnu::noinline]] inline float Lights::meet(const Record& light, const Vec3f& from,
                                            const Vec3f& direction, float t_min, float t_max,
                                            Vec3f& radiance) {
  switch (light.shape) {
    case Shape::Sphere:
      return meet_sphere(light, from, direction, t_min, t_max, radiance);
    case Shape::TurningDisk:
      return meet_turning_disk(light, from, direction, t_min, t_max, radiance);
    case Shape::Rect:
    case Shape::Disk:
      return meet_flat(light, from, direction, t_min, t_max, radiance);
    case Shape::Distant: {
      if (light.one_minus_cos <= 0.0f) return 0.0f;
      // 1 - cos from the difference of the directions keeps narrow suns exact.
      const float off = 0.5f * (direction + light.direction).squaredNorm();
      if (off > light.one_minus_cos) return 0.0f;
      radiance = light.radiance;
      return 1.0f / (2.0f * kPiF * light.one_minus_cos);
    }
    case Shape::Dome: {
      const DomeTexture::Place place = light.texture->place(light.dome_from_world * direction);
      radiance = light.radiance.cwiseProduct(place.radiance);
      return place.density * light.sky->probability(light.sky->cell(from), place.patch);
    }
    case Shape::Triangles:
      break;
  }
  return 0.0f;
}

inline float Lights::meet_sphere(const Record& light, const Vec3f& from, const Vec3f& direction,
                                 float t_min, float t_max, Vec3f& radiance) {
  const Vec3f to_centre = light.position - from;
  const float distance2 = to_centre.squaredNorm();
  const float radius2 = light.radius * light.radius;
  if (distance2 <= radius2) return 0.0f;  // it shines outwards only
  const float along = to_centre.dot(direction);
  const float off2 = (to_centre - along * direction).squaredNorm();
  if (along <= 0.0f || off2 >= radius2) return 0.0f;
  const float t = along - std::sqrt(radius2 - off2);
  if (t < t_min || t >= t_max) return 0.0f;
  radiance = light.radiance * cone_factor(light, -direction);
  return 1.0f / (2.0f * kPiF * one_minus_cos_of(radius2 / distance2));
}

inline float Lights::meet_turning_disk(const Record& light, const Vec3f& from,
                                       const Vec3f& direction, float t_min, float t_max,
                                       Vec3f& radiance) {
  const Vec3f to_centre = light.position - from;
  const float height2 = to_centre.squaredNorm();
  const float along = to_centre.dot(direction);
  if (along <= 0.0f || height2 <= light.radius * light.radius) return 0.0f;
  const float t = height2 / along;
  const float off2 = (t * direction - to_centre).squaredNorm();
  if (t < t_min || t >= t_max || off2 >= light.radius * light.radius) return 0.0f;
  radiance = light.radiance * cone_factor(light, -direction);
  return t * t * t / (std::sqrt(height2) * light.area);
}

[[gnu::noinline]] inline float Lights::meet_flat(const Record& light, const Vec3f& from,
                                                 const Vec3f& direction, float t_min, float t_max,
                                                 Vec3f& radiance) {
  const float cosine = -direction.dot(light.direction);
  if (cosine <= 1e-6f) return 0.0f;
  const float t = (from - light.position).dot(light.direction) / cosine;
  if (t <= t_min || t >= t_max) return 0.0f;
  const Vec3f p = from + t * direction - light.position;
  // Coordinates along the (possibly skew) axes.
  const Vec3f normal = light.axis_x.cross(light.axis_y);
  const float scale = 1.0f / normal.squaredNorm();
  const float x = p.cross(light.axis_y).dot(normal) * scale;
  const float y = light.axis_x.cross(p).dot(normal) * scale;
  const bool is_inside =
      light.shape == Shape::Disk ? x * x + y * y < 1.0f : std::abs(x) < 1.0f && std::abs(y) < 1.0f;
  if (!is_inside) return 0.0f;
  radiance = light.radiance * cone_factor(light, -direction);
  return t * t / (cosine * light.area);
}

}  // namespace diorama
