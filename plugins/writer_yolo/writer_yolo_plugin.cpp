// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_yolo/yolo_reader.h"
#include "writer_yolo/yolo_writer.h"

DIORAMA_PLUGIN("writer_yolo", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(
      diorama::YoloWriter, "YoloWriter",
      "Writes pictures and label lines for YOLO: boxes, polygons, keypoints or rotated boxes.");
  DIORAMA_ADD_READER(diorama::YoloReader, "YoloReader",
                     "Reads YOLO folders, whoever wrote them: pictures, boxes, masks, classes.",
                     "*.yaml *.yml classes.txt *.names labels/*.txt labels/*/*.txt */labels/*.txt");
}
