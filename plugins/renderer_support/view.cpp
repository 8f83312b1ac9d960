// SPDX-License-Identifier: Apache-2.0
#include "view.h"

#include <algorithm>

#include "sampling.h"

namespace diorama {

View::View(const Scene& scene, NodeId node)
    : camera_(*scene[node].camera),
      has_shutter_(camera_.exposure_time_s + camera_.readout_time_s > 0.0),
      body_motion_(body_motion(scene, node)),
      world_from_camera_(scene.world_from_node(node)) {
  motion_ = {world_from_camera_.translation(), camera_.linear_velocity, camera_.angular_velocity};
  world_from_camera_.linear() = Mat3(world_from_camera_.rotation());
  camera_from_world_ = world_from_camera_.inverse();
  pixel_angle_ = float(1.0 / std::max(1.0, 0.5 * (camera_.fx + camera_.fy)));
  const bool has_blur = camera_.f_stop > 0.0 && camera_.focus_distance_m > 0.0;
  aperture_radius_ = has_blur ? 0.5e-3 * camera_.focal_length_mm / camera_.f_stop : 0.0;

  is_plain_ = camera_.lens == LensModel::Pinhole && aperture_radius_ <= 0.0;
  const Mat3& axes = world_from_camera_.linear();
  origin_ = position();
  towards_ = (axes * Vec3(-camera_.cx / camera_.fx, camera_.cy / camera_.fy, -1.0)).cast<float>();
  per_column_ = (axes.col(0) / camera_.fx).cast<float>();
  per_row_ = (-axes.col(1) / camera_.fy).cast<float>();
  near_ = float(camera_.near_m);
  far_ = float(camera_.far_m);
}

std::optional<Vec3> View::direction(const Vec2& pixel) const {
  if (camera_.lens != LensModel::Pinhole) return ray_direction(camera_, pixel);
  return Vec3((pixel.x() - camera_.cx) / camera_.fx, (camera_.cy - pixel.y()) / camera_.fy, -1.0)
      .normalized();
}

CameraRay View::limited(const Vec3& origin, const Vec3& d) const {
  // Near and far are planes; rays that never cross them (wide fisheyes) have spheres.
  const double along_axis = -d.z();
  const double slant = along_axis > 1e-6 ? along_axis : 1.0;
  CameraRay ray;
  ray.origin = (world_from_camera_ * origin).cast<float>();
  ray.direction = Vec3(world_from_camera_.linear() * d).cast<float>().normalized();
  ray.t_min = float(camera_.near_m / slant);
  ray.t_max = float(camera_.far_m / slant);
  return ray;
}

std::optional<CameraRay> View::ray(const Vec2& pixel) const {
  if (camera_.lens == LensModel::Pinhole) return straight_ray(pixel.cast<float>());
  const auto d = ray_direction(camera_, pixel);
  if (!d) return std::nullopt;
  return limited(Vec3::Zero(), *d);
}

double View::seconds(int row, double u) const {
  const double down = (row + 0.5) / camera_.height;
  return (down - 0.5) * camera_.readout_time_s + (u - 0.5) * camera_.exposure_time_s;
}

CameraRay View::moved(const CameraRay& ray, double seconds) const {
  const Affine then_from_now = body_motion_.then_from_now(seconds) * motion_.then_from_now(seconds);
  CameraRay result = ray;
  result.origin = (then_from_now * ray.origin.cast<double>()).cast<float>();
  result.direction = (then_from_now.linear() * ray.direction.cast<double>()).cast<float>();
  return result;
}

CameraRay View::bent_ray(const Vec2& pixel, const Vec2f& aperture) const {
  const auto d = direction(pixel);
  if (!d) return {};
  if (aperture_radius_ <= 0.0 || -d->z() < 1e-6) return limited(Vec3::Zero(), *d);
  const Vec3 focus = *d * (camera_.focus_distance_m / -d->z());
  const Vec2f point = disk_from_square(aperture);
  const Vec3 origin(aperture_radius_ * double(point.x()), aperture_radius_ * double(point.y()),
                    0.0);
  return limited(origin, (focus - origin).normalized());
}

}  // namespace diorama
