// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/camera_rig.h"

#include <algorithm>

namespace diorama {
namespace {

double radians(double degrees) { return degrees * kPi / 180.0; }

/// As the entry says, but for what the member says otherwise.
CameraGroup with_own_lens(CameraGroup group, const RigMember& member) {
  group.width = int(member.width_px.value_or(group.width));
  group.height = int(member.height_px.value_or(group.height));
  group.focal_length_mm = member.focal_length_mm.value_or(group.focal_length_mm);
  group.horizontal_aperture_mm =
      member.horizontal_aperture_mm.value_or(group.horizontal_aperture_mm);
  if (member.fx_px) group.fx_px = member.fx_px;
  if (member.fy_px) group.fy_px = member.fy_px;
  if (member.cx_px) group.cx_px = member.cx_px;
  if (member.cy_px) group.cy_px = member.cy_px;
  return group;
}

/// Turned about the rig's upright axis, which stays its own.
Affine rig_from_member(const RigMember& member, int number) {
  const double turn = -2.0 * kPi * number / member.count;
  const Vec3& angle = member.rotation_deg;
  return Affine(Eigen::AngleAxisd(turn, Vec3::UnitY()) * Eigen::Translation3d(member.position) *
                Eigen::AngleAxisd(radians(angle.z()), Vec3::UnitZ()) *
                Eigen::AngleAxisd(radians(angle.y()), Vec3::UnitY()) *
                Eigen::AngleAxisd(radians(angle.x()), Vec3::UnitX()));
}

}  // namespace

Camera camera_of(const CameraGroup& group) {
  Camera camera = Camera::from_lens(group.width, group.height, group.focal_length_mm,
                                    group.horizontal_aperture_mm);
  if (group.type == "opencv_pinhole") camera.lens = LensModel::OpencvPinhole;
  if (group.type == "fisheye_polynomial") camera.lens = LensModel::FisheyePolynomial;
  camera.fx = group.fx_px.value_or(camera.fx);
  camera.fy = group.fy_px.value_or(camera.fx);
  camera.cx = group.cx_px.value_or(camera.cx);
  camera.cy = group.cy_px.value_or(camera.cy);
  std::copy(group.distortion.begin(), group.distortion.end(), camera.distortion.begin());
  std::copy(group.fisheye_polynomial.begin(), group.fisheye_polynomial.end(),
            camera.fisheye_polynomial.begin());
  camera.fisheye_max_angle_rad = radians(group.fisheye_max_angle_deg);
  camera.near_m = group.near_m;
  camera.far_m = group.far_m;
  camera.f_stop = group.f_stop;
  camera.focus_distance_m = group.focus_distance_m;
  camera.exposure_time_s = group.exposure_time_s;
  camera.readout_time_s = group.readout_time_s;
  return camera;
}

std::vector<PlannedCamera> planned_cameras(const CameraGroup& group) {
  std::vector<PlannedCamera> cameras;
  for (int i = 0; i < group.count; ++i) {
    const std::string name = group.name + "_" + std::to_string(i);
    if (group.rig.empty()) {
      cameras.push_back({name, "", Affine::Identity(), camera_of(group)});
      continue;
    }
    for (const RigMember& member : group.rig) {
      const Camera camera = camera_of(with_own_lens(group, member));
      for (int k = 0; k < member.count; ++k) {
        const std::string number = member.count > 1 ? "_" + std::to_string(k) : "";
        cameras.push_back(
            {name + "_" + member.name + number, name, rig_from_member(member, k), camera});
      }
    }
  }
  return cameras;
}

std::vector<PlannedCamera> planned_cameras(const std::vector<CameraGroup>& groups) {
  std::vector<PlannedCamera> cameras;
  for (const CameraGroup& group : groups) {
    for (PlannedCamera& camera : planned_cameras(group)) cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace diorama
