// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/camera_translator.h"

#include <assimp/version.h>

#include <algorithm>
#include <cmath>

#include "loader_assimp/file_space.h"

namespace diorama::loader_assimp {
namespace {

constexpr int kWidth = 1280;
constexpr double kDefaultAspect = 4.0 / 3.0;
constexpr double kAperture = 20.955;
constexpr double kDefaultAngle = kPi / 4.0;
// assimp 5.2 loses what COLLADA says about cameras and gives less than a degree instead.
constexpr double kLeastAngle = kPi / 180.0;

// Before 5.3 assimp took the horizontal angle of a glTF camera for the vertical one times the
// aspect ratio.
bool has_linear_gltf_angle() {
  return aiGetVersionMajor() < 5 || (aiGetVersionMajor() == 5 && aiGetVersionMinor() < 3);
}

double horizontal_angle(const aiCamera& source, Format format, double aspect) {
  double angle = double(source.mHorizontalFOV);
  if (format == Format::Gltf && has_linear_gltf_angle()) {
    angle = 2.0 * std::atan(std::tan(0.5 * angle / aspect) * aspect);
  }
  const bool is_sane = std::isfinite(angle) && angle > kLeastAngle && angle < kPi - kLeastAngle;
  return is_sane ? angle : kDefaultAngle;
}

}  // namespace

TranslatedCamera translate_camera(const aiCamera& source, Format format, double metres_per_unit) {
  const double stated = double(source.mAspect);
  const double aspect =
      std::isfinite(stated) && stated > 0.01 && stated < 100.0 ? stated : kDefaultAspect;
  const double angle = horizontal_angle(source, format, aspect);
  const int height = std::max(static_cast<int>(std::lround(kWidth / aspect)), 1);
  TranslatedCamera result;
  result.camera =
      Camera::from_lens(kWidth, height, 0.5 * kAperture / std::tan(0.5 * angle), kAperture);
  const double near = double(source.mClipPlaneNear) * metres_per_unit;
  const double far = double(source.mClipPlaneFar) * metres_per_unit;
  if (std::isfinite(near) && near > 0.0) result.camera.near_m = near;
  if (std::isfinite(far) && far > result.camera.near_m) result.camera.far_m = far;

  const Vec3 forward = to_vec3(source.mLookAt);
  const Vec3 up = to_vec3(source.mUp);
  const bool has_axes = forward.allFinite() && up.allFinite() && forward.norm() > 1e-9;
  if (has_axes) result.node_from_camera.linear() = look_rotation(forward, up).toRotationMatrix();
  // glTF's cameras stand at their node; before 5.3 assimp repeats the node's place here.
  const Vec3 position = to_vec3(source.mPosition);
  if (format != Format::Gltf && position.allFinite()) {
    result.node_from_camera.translation() = position;
  }
  return result;
}

}  // namespace diorama::loader_assimp
