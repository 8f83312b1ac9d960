// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_kitti/kitti_reader.h"
#include "writer_kitti/kitti_writer.h"

DIORAMA_PLUGIN("writer_kitti", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::KittiWriter, "KittiWriter",
              "Writes KITTI object or tracking labels with 3-D boxes, calibration and depth.");
  DIORAMA_ADD_READER(
      diorama::KittiReader, "KittiReader",
      "Reads KITTI object and tracking folders, whoever wrote them: pictures, boxes, upright "
      "3-D boxes, cameras, depth.",
      "training/label_2/*.txt label_2/*.txt training/label_02/*.txt label_02/*.txt");
}
