// SPDX-License-Identifier: Apache-2.0
#include "animation_time.h"
#include "camera_lens.h"
#include "camera_motion.h"
#include "camera_path.h"
#include "camera_relative_pose.h"
#include "diorama/plugin.h"
#include "dome_light.h"
#include "joint_positions.h"
#include "look_at.h"
#include "orbit_cameras.h"
#include "pull_together.h"
#include "random_colors.h"
#include "random_labels.h"
#include "random_material.h"
#include "random_texture.h"
#include "random_variant.h"
#include "random_velocities.h"
#include "random_visibility.h"
#include "scatter_lights.h"
#include "scatter_poses.h"

DIORAMA_PLUGIN("randomizers_core", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::ScatterPoses, "scatter_poses",
              "Places, turns and scales nodes at random near the working area.");
  DIORAMA_ADD(diorama::ScatterLights, "scatter_lights",
              "Places lights at random near the working area, in random colours.");
  DIORAMA_ADD(diorama::DomeLight, "dome_light", "Picks and turns the sky of dome lights.");
  DIORAMA_ADD(diorama::RandomColors, "random_colors", "Gives every mesh a plain random colour.");
  DIORAMA_ADD(diorama::RandomMaterial, "random_material",
              "Draws the materials of every mesh, or their roughness and metalness.");
  DIORAMA_ADD(diorama::RandomTexture, "random_texture", "Puts a random picture on every mesh.");
  DIORAMA_ADD(diorama::RandomLabels, "random_labels", "Draws, adds or clears the labels of nodes.");
  DIORAMA_ADD(diorama::RandomVariant, "random_variant",
              "Gives objects the looks of a variant of their asset.");
  DIORAMA_ADD(diorama::RandomVelocities, "random_velocities",
              "Throws objects: draws how fast they move and turn, all or those in a box.");
  DIORAMA_ADD(diorama::PullTogether, "pull_together",
              "Sends objects towards the working area, the farther the faster.");
  DIORAMA_ADD(diorama::RandomVisibility, "random_visibility", "Shows or hides nodes by chance.");
  DIORAMA_ADD(diorama::JointPositions, "joint_states",
              "Opens doors and drawers: draws positions of joints within their limits.");
  DIORAMA_ADD(diorama::OrbitCameras, "orbit_cameras",
              "Places cameras round random targets and looks at them.");
  DIORAMA_ADD(diorama::LookAt, "look_at", "Turns nodes towards random targets.");
  DIORAMA_ADD(diorama::AnimationTime, "animation_time",
              "Shows animated assets as they are at a time that is drawn.");
  DIORAMA_ADD(diorama::CameraRelativePose, "camera_relative_pose",
              "Places nodes in a camera's picture, at a distance from it.");
  DIORAMA_ADD(diorama::CameraLens, "camera_lens", "Draws focal length and focus of cameras.");
  DIORAMA_ADD(diorama::CameraMotion, "camera_motion",
              "Draws how cameras move while the shutter is open.");
  DIORAMA_ADD(diorama::CameraPath, "camera_path",
              "Moves cameras through clips: by keys, round or after targets, through free space.");
}
