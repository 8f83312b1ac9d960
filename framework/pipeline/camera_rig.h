// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/camera.h"
#include "diorama/math.h"
#include "framework/pipeline/job.h"

namespace diorama {

/// A camera of a job: one that stands alone, or a member of a rig, which moves as one.
struct PlannedCamera {
  std::string name;  ///< Of its node: "cam_0", "stereo_0_left"; unique.
  std::string rig;   ///< Name of the node above it, "stereo_0"; empty: it stands alone.
  /// Camera space is x right, y up, z back; so is the rig's. Metres.
  Affine rig_from_camera = Affine::Identity();
  Camera camera;
};

/// The cameras of one entry, in order: those of its first rig, of its second ...
std::vector<PlannedCamera> planned_cameras(const CameraGroup& group);
/// Of all entries of a job.
std::vector<PlannedCamera> planned_cameras(const std::vector<CameraGroup>& groups);

/// The described lens in pixels.
Camera camera_of(const CameraGroup& group);

}  // namespace diorama
