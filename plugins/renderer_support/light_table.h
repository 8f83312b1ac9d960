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
#include "sun_grid.h"

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
  std::uint32_t instance = 0;
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

enum class LightShape : std::uint8_t { Sphere, TurningDisk, Rect, Disk, Distant, Dome, Triangles };
inline constexpr std::size_t kLightShapes = 7;

/// All that emits, in tables: by light, and in columns for loops over many. Filled by add(), made
/// ready by finish(). What render kernels call is inline: it is compiled into each of them.
class LightTable {
 public:
  struct Record {
    LightShape shape = LightShape::Sphere;
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
    std::shared_ptr<const SkyGrid> sky;  ///< Of a dome ...
    std::shared_ptr<const SunGrid> sun;  ///< ... and of a distant light.
    std::uint32_t instance = 0;
    std::vector<EmittingTriangles::Triangle> triangles;
    std::vector<float> cumulative_area;

    /// Whether it has a place in the scene.
    bool is_body() const { return shape != LightShape::Distant && shape != LightShape::Dome; }
  };

  /// What draws read of the lights, by their numbers: for loops over places, each with its light.
  struct Columns {
    using Vectors = std::array<std::vector<float>, 3>;
    std::vector<std::int32_t> shape;
    Vectors position, axis_x, axis_y, direction;
    std::vector<float> radius, area, one_minus_cos;
    void add(const Record& light);
  };
  /// `has_disk_lamps`: spheres shine like disks that turn to every point they light, as in Cycles;
  /// points closer than a few radii get less light from them than from a sphere.
  explicit LightTable(bool has_disk_lamps = false) : has_disk_lamps_(has_disk_lamps) {}

  /// `texture`: of a dome; one without an image has a white one.
  void add(const Light& light, const Affine& world_from_node,
           std::shared_ptr<const DomeTexture> texture);
  /// Returns the light's number; triangles without area are dropped.
  std::uint32_t add(EmittingTriangles triangles);

  /// Builds the tables for choosing and drawing; call after the last add().
  void finish();
  /// Which parts of a dome can be seen from where, and from where a distant light.
  using SkyGridOf = std::function<std::shared_ptr<const SkyGrid>(
      const std::shared_ptr<const DomeTexture>&, const Eigen::Matrix3f& world_from_dome)>;
  using SunGridOf =
      std::function<std::shared_ptr<const SunGrid>(const Vec3f& towards, float one_minus_cos)>;
  /// Before, all is seen from everywhere.
  void learn_surroundings(const SkyGridOf& sky_grid_of, const SunGridOf& sun_grid_of);

  bool is_empty() const { return records_.empty(); }
  std::size_t count() const { return records_.size(); }

  const std::vector<Record>& records() const { return records_; }
  /// Lamps and suns, also those in the picture of a sky.
  bool has_small_lights() const;
  bool is_small_light(const LightPlace& place) const {
    const Record& light = records_[place.light];
    return light.shape != LightShape::Dome || light.texture->is_sun(place.place);
  }
  bool has_lamps() const;
  bool is_lamp(const LightPlace& place) const { return is_lamp(records_[place.light]); }
  const Columns& columns() const { return columns_; }
  /// Over the bodies.
  const LightTree& tree() const { return tree_; }
  /// All with a place, in the order of the tree ...
  const std::vector<std::uint32_t>& bodies() const { return bodies_; }
  /// ... and per light: its number among them.
  const std::vector<std::uint32_t>& order() const { return order_; }
  /// Spheres, rects and disks: rays may meet them.
  const std::vector<std::uint32_t>& shapes() const { return shapes_; }
  /// Distant lights and domes.
  const std::vector<std::uint32_t>& surroundings() const { return surroundings_; }
  /// What is compared to choose a light: the roots of the tree, then the surroundings. The light of
  /// each; -1: a group of the tree.
  const std::vector<std::int32_t>& entry_lights() const { return entry_lights_; }

  /// The radiance of a sample that leaves along `direction` (unit, from the receiver). Apart from
  /// sample_lights() because a dome's image is large: it is read only when the sample turns out to
  /// be lit.
  Vec3f radiance_of(const LightPlace& place, const Vec3f& direction) const;
  /// Whether the sample lies on a mesh, whose material knows the radiance.
  bool is_surface(const LightPlace& place) const {
    return records_[place.light].shape == LightShape::Triangles;
  }
  std::uint32_t instance_of(const LightPlace& place) const {
    return records_[place.light].instance;
  }
  /// Density per solid angle of an emitting triangle's point, seen from `from`.
  float density_of_surface(std::uint32_t light, float distance, float cos_at_light) const;

  /// Sets `may_hit` for rays that pass through a sphere around a light without a mesh that has a
  /// place; other rays need not ask along_ray() but for dome and distant lights.
  void find_near(std::size_t count, const BatchVectors& origin, const BatchVectors& direction,
                 BatchInts& may_hit) const;
  /// What a ray meets of lights without a mesh, from t_min to t_max, and of dome and distant lights
  /// when t_max is infinite. Calls found(light, radiance, density) for each; the density is that of
  /// sample_lights() from `from`, the start of the ray: for one that went straight through panes,
  /// the place that took the light sample, with t_min at the last pane.
  template <class Found>
  void along_ray(const Vec3f& from, const Vec3f& direction, float t_min, float t_max,
                 bool is_camera_ray, Found&& found) const;

 private:
  static bool is_lamp(const Record& light) {
    return light.shape != LightShape::Dome && light.shape != LightShape::Distant;
  }

  /// Of triangles that shine on one side only, or nearly so, and face similar ways.
  static void find_direction(Record& light);
  static bool is_near(const Record& light, const Vec3f& from, const Vec3f& direction);
  static float cone_factor(const Record& light, const Vec3f& from_light);
  /// Returns the density; zero: not met.
  static float intersect_light(const Record& light, const Vec3f& from, const Vec3f& direction,
                               float t_min, float t_max, Vec3f& radiance);
  static float intersect_sphere(const Record& light, const Vec3f& from, const Vec3f& direction,
                                float t_min, float t_max, Vec3f& radiance);
  static float intersect_turning_disk(const Record& light, const Vec3f& from,
                                      const Vec3f& direction, float t_min, float t_max,
                                      Vec3f& radiance);
  static float intersect_flat(const Record& light, const Vec3f& from, const Vec3f& direction,
                              float t_min, float t_max, Vec3f& radiance);

  bool has_disk_lamps_;
  std::vector<Record> records_;
  std::vector<std::uint32_t> shapes_;
  std::vector<std::uint32_t> bodies_;
  std::vector<std::uint32_t> surroundings_;
  std::vector<std::uint32_t> order_;
  LightTree tree_;
  Columns columns_;
  std::vector<std::int32_t> entry_lights_;
};

// One minus the cosine of the half angle under which a sphere of this squared sine is seen, without
// cancellation.
inline float one_minus_cos_of(float sin2) {
  return sin2 / (1.0f + std::sqrt(std::max(0.0f, 1.0f - sin2)));
}

inline bool LightTable::is_near(const Record& light, const Vec3f& from, const Vec3f& direction) {
  const Vec3f to = light.position - from;
  const float along = to.dot(direction);
  const float off2 = (to - along * direction).squaredNorm();
  return (off2 < light.radius * light.radius) & (along + light.radius > 0.0f);
}

inline void LightTable::find_near(std::size_t count, const BatchVectors& origin,
                                  const BatchVectors& direction, BatchInts& may_hit) const {
  may_hit.fill(0);
  for (const std::uint32_t index : shapes_) {
    const Record& light = records_[index];
    for (std::size_t i = 0; i < whole_steps(count); ++i) {
      may_hit[i] |= std::int32_t(is_near(light, origin.at(i), direction.at(i)));
    }
  }
}

template <class Found>
void LightTable::along_ray(const Vec3f& from, const Vec3f& direction, float t_min, float t_max,
                           bool is_camera_ray, Found&& found) const {
  const auto report = [&](std::uint32_t index) {
    const Record& light = records_[index];
    if (is_camera_ray && !light.is_visible_to_camera) return;
    Vec3f radiance = Vec3f::Zero();
    const float density = intersect_light(light, from, direction, t_min, t_max, radiance);
    if (density > 0.0f) found(index, radiance, density);
  };
  for (const std::uint32_t index : shapes_) {
    if (is_near(records_[index], from, direction)) report(index);
  }
  if (t_max == kInfinite) {
    for (const std::uint32_t index : surroundings_) report(index);
  }
}

inline float LightTable::cone_factor(const Record& light, const Vec3f& from_light) {
  if (light.cos_outer < -1.0f) return 1.0f;
  const float c = from_light.dot(light.direction);
  const float t =
      std::clamp((c - light.cos_outer) / (light.cos_inner - light.cos_outer), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

inline Vec3f LightTable::radiance_of(const LightPlace& place, const Vec3f& direction) const {
  const Record& light = records_[place.light];
  if (light.shape != LightShape::Dome) return light.radiance * cone_factor(light, -direction);
  return light.radiance.cwiseProduct(light.texture->radiance_at(place.place));
}

inline float LightTable::density_of_surface(std::uint32_t light, float distance,
                                            float cos_at_light) const {
  return distance * distance / (std::max(1e-6f, std::abs(cos_at_light)) * records_[light].area);
}

[[gnu::noinline]] inline float LightTable::intersect_light(const Record& light, const Vec3f& from,
                                                           const Vec3f& direction, float t_min,
                                                           float t_max, Vec3f& radiance) {
  switch (light.shape) {
    case LightShape::Sphere:
      return intersect_sphere(light, from, direction, t_min, t_max, radiance);
    case LightShape::TurningDisk:
      return intersect_turning_disk(light, from, direction, t_min, t_max, radiance);
    case LightShape::Rect:
    case LightShape::Disk:
      return intersect_flat(light, from, direction, t_min, t_max, radiance);
    case LightShape::Distant: {
      if (light.one_minus_cos <= 0.0f) return 0.0f;
      // 1 - cos from the difference of the directions keeps narrow suns exact.
      const float off = 0.5f * (direction + light.direction).squaredNorm();
      if (off > light.one_minus_cos) return 0.0f;
      radiance = light.radiance;
      return 1.0f / (2.0f * kPiF * light.one_minus_cos);
    }
    case LightShape::Dome: {
      const DomeTexture::Place place = light.texture->place(light.dome_from_world * direction);
      radiance = light.radiance.cwiseProduct(place.radiance);
      return place.density * light.sky->probability(light.sky->grid().cell(from), place.patch);
    }
    case LightShape::Triangles:
      break;
  }
  return 0.0f;
}

inline float LightTable::intersect_sphere(const Record& light, const Vec3f& from,
                                          const Vec3f& direction, float t_min, float t_max,
                                          Vec3f& radiance) {
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

inline float LightTable::intersect_turning_disk(const Record& light, const Vec3f& from,
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

[[gnu::noinline]] inline float LightTable::intersect_flat(const Record& light, const Vec3f& from,
                                                          const Vec3f& direction, float t_min,
                                                          float t_max, Vec3f& radiance) {
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
  const bool is_inside = light.shape == LightShape::Disk ? x * x + y * y < 1.0f
                                                         : std::abs(x) < 1.0f && std::abs(y) < 1.0f;
  if (!is_inside) return 0.0f;
  radiance = light.radiance * cone_factor(light, -direction);
  return t * t / (cosine * light.area);
}

}  // namespace diorama
