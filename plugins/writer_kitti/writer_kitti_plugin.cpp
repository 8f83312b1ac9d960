// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_kitti/kitti_writer.h"

DIORAMA_PLUGIN("writer_kitti", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::KittiWriter, "KittiWriter",
              "Writes KITTI object labels with 3-D boxes, calibration and depth.");
}
