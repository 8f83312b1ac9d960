// SPDX-License-Identifier: Apache-2.0
#include "camera_sensor.h"
#include "depth_sensor.h"
#include "diorama/plugin.h"

DIORAMA_PLUGIN("annotators_sensor", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD_ANNOTATOR(
      diorama::CameraSensor, "camera_sensor",
      "Pictures as a camera takes them: exposure, vignetting, colour fringes, shot and read "
      "noise.",
      "color_hdr", "color");
  DIORAMA_ADD_ANNOTATOR(
      diorama::DepthSensor, "depth_sensor",
      "Depth as a stereo or structured light camera measures it, with noise and holes.",
      "distance_to_image_plane", "sensor_depth");
}
