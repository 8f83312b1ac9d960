// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_coco/coco_reader.h"
#include "writer_coco/coco_writer.h"

DIORAMA_PLUGIN("writer_coco", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::CocoWriter, "CocoWriter",
              "Writes COCO detection, segmentation, keypoint and panoptic annotations.");
  DIORAMA_ADD_READER(diorama::CocoReader, "CocoReader",
                     "Reads COCO folders, whoever wrote them: pictures, boxes, masks, classes.",
                     "annotations/*.json instances*.json annotations.json labels.json *.coco.json "
                     "*/_annotations.coco.json");
}
