// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "diorama/light.h"
#include "dome.h"
#include "sampling.h"
#include "sky_grid.h"

namespace diorama {

/// The triangles of one emitting material of one mesh in the scene, in world space.
struct EmittingTriangles {
  struct Triangle {
    Vec3f a, ab, ac;          ///< Corner and edges.
    std::uint32_t index = 0;  ///< In its mesh.
  };
  std::vector<Triangle> triangles;
  std::uint32_t geometry = 0;
  bool is_double_sided = true;
  bool is_mirrored = false;  ///< The front is where the corners run clockwise.
  Vec3f mean_radiance = Vec3f::Zero();
};

/// Where light is wanted.
struct Receiver {
  Vec3f position = Vec3f::Zero();
  Vec3f normal = Vec3f::UnitZ();
  bool is_two_sided = false;  ///< Light from behind counts as well.
  float total_score = 0.0f;   ///< Written by Lights::choose.
};

struct LightSample {
  Vec3f direction = Vec3f::Zero();  ///< Unit, from the receiver.
  float distance = 0.0f;            ///< Infinite for dome and distant lights.
  /// Radiance arriving; for emitting triangles to be read off the surface (`triangle`, `u`, `v`).
  Vec3f radiance = Vec3f::Zero();
  /// Per solid angle, without the choice of the light. Infinite: `radiance` is an irradiance, and
  /// no other technique can find the light.
  float density = 0.0f;
  std::uint32_t geometry = 0;
  std::uint32_t triangle = 0;
  Vec2f barycentric = Vec2f::Zero();
  bool is_surface = false;
};

/// All that emits. A light is chosen in proportion to its unshadowed contribution (estimated), so
/// that one shadow ray per vertex goes where it matters.
class Lights {
 public:
  /// `texture`: of a dome; one without an image has a white one.
  void add(const Light& light, const Affine& world_from_node,
           std::shared_ptr<const DomeTexture> texture);
  /// Returns the light's number; triangles without area are dropped.
  std::uint32_t add(EmittingTriangles triangles);

  /// Finds out which parts of the domes can be seen from where in the scene.
  void learn_sky(const Aabb& bounds, const SkyGrid::Sees& sees, Host& host);

  bool is_empty() const { return lights_.empty(); }
  std::size_t count() const { return lights_.size(); }

  struct Choice {
    std::uint32_t light = 0;
    float probability = 0.0f;  ///< Zero: no light can contribute.
  };
  /// Fills receiver.total_score.
  Choice choose(Receiver& receiver, float u) const;
  /// Probability with which choose() picks this light for the receiver.
  float probability(std::uint32_t light, const Receiver& receiver) const;

  /// Density zero: nothing arrives from this light.
  LightSample sample(std::uint32_t light, const Vec3f& from, const Vec2f& u) const;
  /// Density per solid angle of an emitting triangle's point, seen from `from`.
  float density_of_surface(std::uint32_t light, float distance, float cos_at_light) const;

  /// What a ray meets of lights without a mesh, up to t_max, and of dome and distant lights when
  /// t_max is infinite. Calls found(light, radiance, density) for each; the density is that of
  /// sample() from `from`, the start of the ray.
  template <class Found>
  void along_ray(const Vec3f& from, const Vec3f& direction, float t_max, bool is_camera_ray,
                 Found&& found) const {
    const auto report = [&](std::uint32_t index) {
      const Record& light = lights_[index];
      if (is_camera_ray && !light.is_visible_to_camera) return;
      Vec3f radiance;
      const float density = meet(light, from, direction, t_max, radiance);
      if (density > 0.0f) found(index, radiance, density);
    };
    for (std::uint32_t index : bodies_) report(index);
    if (t_max == std::numeric_limits<float>::infinity()) {
      for (std::uint32_t index : surroundings_) report(index);
    }
  }

 private:
  enum class Shape : std::uint8_t { Sphere, Rect, Disk, Distant, Dome, Triangles };
  struct Record {
    Shape shape = Shape::Sphere;
    Vec3f position = Vec3f::Zero();
    Vec3f axis_x = Vec3f::UnitX();  ///< Half extents of rect and disk.
    Vec3f axis_y = Vec3f::UnitY();
    Vec3f direction = -Vec3f::UnitZ();  ///< Unit, that it shines along.
    float radius = 0.0f;                ///< Of the sphere, or of a sphere around the body.
    float area = 0.0f;
    Vec3f radiance = Vec3f::Zero();  ///< Irradiance for a distant light of zero size.
    float power = 0.0f;              ///< Luminous weight in scores.
    float one_minus_cos = 0.0f;      ///< Distant: of its angular radius.
    float cos_outer = -2.0f;         ///< Cone; below -1: none.
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

  float score(const Record& light, const Receiver& receiver) const;
  static float cone_factor(const Record& light, const Vec3f& from_light);
  static float meet(const Record& light, const Vec3f& from, const Vec3f& direction, float t_max,
                    Vec3f& radiance);
  static LightSample sample_sphere(const Record& light, const Vec3f& from, const Vec2f& u);
  static LightSample sample_flat(const Record& light, const Vec3f& from, const Vec2f& u);
  static LightSample sample_distant(const Record& light, const Vec2f& u);
  static LightSample sample_dome(const Record& light, const Vec3f& from, const Vec2f& u);
  static LightSample sample_triangles(const Record& light, const Vec3f& from, const Vec2f& u);
  void add_record(Record record);

  std::vector<Record> lights_;
  std::vector<std::uint32_t> bodies_;        ///< Sphere, rect, disk.
  std::vector<std::uint32_t> surroundings_;  ///< Distant, dome.
};

}  // namespace diorama
