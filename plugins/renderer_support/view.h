// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <optional>

#include "diorama/scene.h"
#include "rigid_motion.h"

namespace diorama {

struct CameraRay {
  Vec3f origin = Vec3f::Zero();
  Vec3f direction = -Vec3f::UnitZ();  ///< Unit.
  float t_min = 0.0f;                 ///< Near and far plane along this ray.
  float t_max = 0.0f;
};

/// One camera at its place. Rays are in world space; scale of the camera's node is left out.
class View {
 public:
  View(const Scene& scene, NodeId camera);

  const Camera& camera() const { return camera_; }
  const Affine& camera_from_world() const { return camera_from_world_; }
  Vec3f position() const { return world_from_camera_.translation().cast<float>(); }
  /// Angle between the rays of neighbouring pixels at the image centre, radians.
  float pixel_angle() const { return pixel_angle_; }

  /// Nothing where the lens images nothing.
  std::optional<CameraRay> ray(const Vec2& pixel) const;
  /// The same through a point of the aperture, for cameras with depth of field; t_max is zero where
  /// the lens images nothing. Inline and in single precision for cameras without either.
  CameraRay sample_ray(const Vec2f& pixel, const Vec2f& aperture) const {
    return is_plain_ ? straight_ray(pixel) : bent_ray(pixel.cast<double>(), aperture);
  }

  /// Rays of a pinhole without depth of field leave `origin` towards
  /// towards + x per_column + y per_row, which is one metre deep.
  struct Pinhole {
    Vec3f origin, towards, per_column, per_row;
    float near, far;  ///< Along the axis.
  };
  std::optional<Pinhole> pinhole() const {
    if (!is_plain_) return std::nullopt;
    return Pinhole{origin_, towards_, per_column_, per_row_, near_, far_};
  }

  /// Whether sample_ray() heeds the point of the aperture.
  bool has_aperture() const { return aperture_radius_ > 0.0; }
  /// Whether rows or samples see different moments.
  bool has_shutter() const { return has_shutter_; }
  /// Seconds after the moment of the scene's poses at which a row is seen; `u` in [0, 1) goes
  /// through its exposure.
  double seconds(int row, double u) const;
  /// A ray of the camera as it stands at that time.
  CameraRay moved(const CameraRay& ray, double seconds) const;

 private:
  /// Through a pinhole.
  CameraRay straight_ray(const Vec2f& pixel) const {
    CameraRay ray;
    const Vec3f d = towards_ + pixel.x() * per_column_ + pixel.y() * per_row_;
    const float slant = std::sqrt(d.squaredNorm());
    ray.origin = origin_;
    ray.direction = d * (1.0f / slant);
    ray.t_min = near_ * slant;
    ray.t_max = far_ * slant;
    return ray;
  }
  CameraRay bent_ray(const Vec2& pixel, const Vec2f& aperture) const;
  std::optional<Vec3> direction(const Vec2& pixel) const;
  CameraRay limited(const Vec3& origin, const Vec3& direction_camera) const;

  Camera camera_;
  bool has_shutter_;
  RigidMotion motion_;       ///< Its own ...
  RigidMotion body_motion_;  ///< ... on top of what it rides on.
  Affine world_from_camera_;
  Affine camera_from_world_;
  float pixel_angle_;
  double aperture_radius_;  ///< Metres; 0: no depth of field.
  bool is_plain_;           ///< A pinhole without depth of field.
  // Rays of pinholes are towards_ + x per_column_ + y per_row_, one metre deep.
  Vec3f origin_;
  Vec3f towards_;
  Vec3f per_column_;
  Vec3f per_row_;
  float near_;
  float far_;
};

}  // namespace diorama
