// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "batch.h"
#include "light_choice.h"
#include "light_table.h"
#include "sampling.h"

namespace diorama {

/// Points of the lights chosen for a batch of places.
struct LightSamples {
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

namespace detail {

/// The lights of a batch of places, and where on them; see LightTable::Record.
struct SurfaceBatch {
  BatchVectors to_light;  ///< To its position.
  BatchFloats radius, area, one_minus_cos;
  BatchVectors axis_x, axis_y, shines_along;
  BatchFloats u, v;
};

/// A point of a light, seen from a place.
struct LightDraw {
  Vec3f direction;
  float distance = 0.0f;
  float density = 0.0f;
};

inline void look_up(const LightTable::Columns::Vectors& columns, const BatchInts& lights,
                    std::size_t size, BatchVectors& values) {
  gather(columns[0], lights, size, values.x);
  gather(columns[1], lights, size, values.y);
  gather(columns[2], lights, size, values.z);
}

inline void look_up(const LightTable& table, LightShape shape, const BatchInts& lights,
                    std::size_t size, SurfaceBatch& points) {
  look_up(table.columns().position, lights, size, points.to_light);
  gather(table.columns().radius, lights, size, points.radius);
  gather(table.columns().area, lights, size, points.area);
  if (shape == LightShape::Sphere || shape == LightShape::TurningDisk) return;
  gather(table.columns().one_minus_cos, lights, size, points.one_minus_cos);
  look_up(table.columns().axis_x, lights, size, points.axis_x);
  look_up(table.columns().axis_y, lights, size, points.axis_y);
  look_up(table.columns().direction, lights, size, points.shines_along);
}

inline LightDraw draw_sphere(const SurfaceBatch& points, std::size_t i) {
  const Vec3f to_centre = points.to_light.at(i);
  const float radius2 = points.radius[i] * points.radius[i];
  const float distance2 = to_centre.squaredNorm();
  const float sin2 = radius2 / distance2;
  const float distance = std::sqrt(distance2);
  const float one_minus_cos = one_minus_cos_of(sin2);
  const Vec3f local = uniform_cone({points.u[i], points.v[i]}, one_minus_cos);
  const Vec3f direction = unit(basis_around(to_centre * (1.0f / distance)).to_world(local));
  const float sine2 = std::max(0.0f, 1.0f - local.z() * local.z());
  const float within = std::sqrt(std::max(0.0f, radius2 - distance2 * sine2));
  const float density = 1.0f / (2.0f * kPiF * one_minus_cos);
  return {direction, distance * local.z() - within, sin2 < 1.0f ? density : 0.0f};
}

inline LightDraw draw_turning_disk(const SurfaceBatch& points, std::size_t i) {
  const Vec3f to_centre = points.to_light.at(i);
  const float height2 = to_centre.squaredNorm();
  const Basis basis = basis_around(unit(to_centre));
  const Vec2f p = disk_from_square({points.u[i], points.v[i]}) * points.radius[i];
  const Vec3f to_light = to_centre + p.x() * basis.x + p.y() * basis.y;
  const float distance2 = to_light.squaredNorm();
  const float distance = std::sqrt(distance2);
  const float density = distance2 * distance / (std::sqrt(height2) * points.area[i]);
  const bool is_outside = height2 > points.radius[i] * points.radius[i];
  return {to_light * (1.0f / distance), distance, is_outside ? density : 0.0f};
}

inline LightDraw draw_flat(const SurfaceBatch& points, std::size_t i, bool is_disk) {
  const Vec2f u(points.u[i], points.v[i]);
  const Vec2f p = is_disk ? disk_from_square(u) : Vec2f(2.0f * u.x() - 1.0f, 2.0f * u.y() - 1.0f);
  const Vec3f to_light =
      points.to_light.at(i) + p.x() * points.axis_x.at(i) + p.y() * points.axis_y.at(i);
  const float distance2 = to_light.squaredNorm();
  const float distance = std::sqrt(distance2);
  const Vec3f direction = to_light * (1.0f / distance);
  const float cosine = -direction.dot(points.shines_along.at(i));
  const float density = distance2 / (cosine * points.area[i]);
  return {direction, distance, cosine > 1e-6f ? density : 0.0f};
}

inline LightDraw draw_distant(const SurfaceBatch& points, std::size_t i) {
  const Vec3f towards = -points.shines_along.at(i);
  const float one_minus_cos = points.one_minus_cos[i];
  const Vec3f local = uniform_cone({points.u[i], points.v[i]}, one_minus_cos);
  const Vec3f direction = unit(basis_around(towards).to_world(local));
  const float density = 1.0f / (2.0f * kPiF * one_minus_cos);
  const bool has_size = one_minus_cos > 0.0f;
  return {select(has_size, direction, towards), kInfinite, has_size ? density : kInfinite};
}

/// For all places, as if each had a light of this shape; kept for those that have.
template <class DrawOne>
inline void draw_all(const LightTable& table, LightShape shape, const LightQueries& queries,
                     const BatchFloats& u, const BatchFloats& v, LightSamples& samples,
                     DrawOne&& draw_one) {
  const std::size_t size = whole_steps(queries.count);
  SurfaceBatch points;
  look_up(table, shape, samples.light, size, points);
  for (std::size_t i = 0; i < size; ++i) {
    points.to_light.set(i, points.to_light.at(i) - queries.position.at(i));
    points.u[i] = u[i];
    points.v[i] = v[i];
  }
  BatchVectors directions;
  BatchFloats distances;
  BatchFloats densities;
  for (std::size_t i = 0; i < size; ++i) {
    const LightDraw draw = draw_one(points, i);
    directions.set(i, draw.direction);
    distances[i] = draw.distance;
    densities[i] = draw.density;
  }
  BatchInts shapes;
  gather(table.columns().shape, samples.light, size, shapes);
  for (std::size_t i = 0; i < size; ++i) {
    const bool is_own = shapes[i] == std::int32_t(shape);
    samples.direction.set(i, select(is_own, directions.at(i), samples.direction.at(i)));
    samples.distance[i] = select(is_own, distances[i], samples.distance[i]);
    samples.density[i] = select(is_own, densities[i], samples.density[i]);
  }
}

inline void draw_dome(const LightTable& table, std::uint32_t number, const LightQueries& queries,
                      const BatchFloats& u, const BatchFloats& v, LightSamples& samples) {
  const LightTable::Record& light = table.records()[number];
  std::array<std::uint8_t, kBatch> index;
  std::size_t count = 0;
  for (std::size_t i = 0; i < queries.count; ++i) {
    index[count] = std::uint8_t(i);
    count += samples.light[i] == std::int32_t(number) ? 1 : 0;
  }
  BatchInts cells;
  light.sky->grid().find_cells(queries.position, whole_steps(queries.count), cells);
  // In steps, each of which knows what the next one reads.
  std::array<SkyGrid::Choice, kBatch> choices;
  for (std::size_t k = 0; k < count; ++k) {
    choices[k] = light.sky->choose(std::uint32_t(cells[index[k]]), u[index[k]]);
  }
  BatchFloats rows;
  for (std::size_t k = 0; k < count; ++k) {
    const SquareDistribution& patch = light.texture->patches()[std::size_t(choices[k].patch)];
    rows[k] = patch.row(v[index[k]]);
    patch.prefetch_row(rows[k]);
  }
  BatchFloats x;
  BatchFloats y;
  BatchFloats density;
  for (std::size_t k = 0; k < count; ++k) {
    const SkyGrid::Choice& choice = choices[k];
    const DomeTexture::Draw draw = light.texture->sample_row(choice.patch, rows[k], choice.rest);
    x[k] = draw.place.x();
    y[k] = draw.place.y();
    density[k] = draw.density * choice.probability;
    light.texture->prefetch(draw.place);
  }
  const Basis axes{light.dome_from_world.row(0), light.dome_from_world.row(1),
                   light.dome_from_world.row(2)};
  BatchVectors directions;
  for (std::size_t k = 0; k < whole_steps(count); ++k) {
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

[[gnu::noinline]] inline void draw_triangles(const LightTable& table, const LightQueries& queries,
                                             const BatchFloats& u, const BatchFloats& v,
                                             LightSamples& samples) {
  for (std::size_t i = 0; i < queries.count; ++i) {
    const LightTable::Record& light = table.records()[std::uint32_t(samples.light[i])];
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
    const Vec3f to_light = t.a + weights.x() * t.ab + weights.y() * t.ac - queries.position.at(i);
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

inline void draw_shape(const LightTable& table, LightShape shape, const LightQueries& queries,
                       const BatchFloats& u, const BatchFloats& v, LightSamples& samples) {
  switch (shape) {
    case LightShape::Sphere:
      return draw_all(table, shape, queries, u, v, samples, draw_sphere);
    case LightShape::TurningDisk:
      return draw_all(table, shape, queries, u, v, samples, draw_turning_disk);
    case LightShape::Rect:
      return draw_all(
          table, shape, queries, u, v, samples,
          [](const SurfaceBatch& points, std::size_t i) { return draw_flat(points, i, false); });
    case LightShape::Disk:
      return draw_all(
          table, shape, queries, u, v, samples,
          [](const SurfaceBatch& points, std::size_t i) { return draw_flat(points, i, true); });
    case LightShape::Distant:
      return draw_all(table, shape, queries, u, v, samples, draw_distant);
    case LightShape::Dome:
      for (const std::uint32_t number : table.surroundings()) {
        if (table.records()[number].shape == shape)
          draw_dome(table, number, queries, u, v, samples);
      }
      return;
    case LightShape::Triangles:
      return draw_triangles(table, queries, u, v, samples);
  }
}

}  // namespace detail

/// Points on the chosen lights; `u`, `v` in [0, 1) place them.
inline void sample_lights(const LightTable& table, const LightQueries& queries,
                          const LightSelections& selections, const BatchFloats& u,
                          const BatchFloats& v, LightSamples& samples) {
  const std::size_t size = whole_steps(queries.count);
  samples.light = selections.light;
  std::fill_n(samples.density.begin(), size, 0.0f);
  // Places without a light have a direction as well: loops over all of them look up tables by it.
  for (std::size_t i = 0; i < size; ++i) samples.direction.set(i, Vec3f::Zero());
  if (table.records().empty()) return;
  const std::int32_t* shapes = table.columns().shape.data();
  std::uint32_t present = 0;
  for (std::size_t i = 0; i < queries.count; ++i) {
    const std::uint32_t own = 1u << shapes[samples.light[i]];
    present |= selections.probability[i] > 0.0f ? own : 0u;
  }
  for (std::uint32_t shape = 0; shape < kLightShapes; ++shape) {
    if ((present >> shape & 1u) != 0)
      detail::draw_shape(table, LightShape(shape), queries, u, v, samples);
  }
  for (std::size_t i = 0; i < size; ++i) {
    samples.density[i] = selections.probability[i] > 0.0f ? samples.density[i] : 0.0f;
  }
}

}  // namespace diorama
