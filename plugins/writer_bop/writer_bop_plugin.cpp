// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_bop/bop_reader.h"
#include "writer_bop/bop_writer.h"

DIORAMA_PLUGIN("writer_bop", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::BopWriter, "BopWriter",
              "Writes 6-D object poses, masks and depth in the BOP format.");
  DIORAMA_ADD_READER(diorama::BopReader, "BopReader",
                     "Reads datasets of the BOP benchmark: a dataset, a split or a scene.",
                     "scene_camera*.json scene_gt*.json */scene_camera*.json */scene_gt*.json "
                     "*/*/scene_gt*.json */*/scene_camera*.json models/models_info.json");
}
