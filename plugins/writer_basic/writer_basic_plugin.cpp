// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_basic/basic_reader.h"
#include "writer_basic/basic_writer.h"

DIORAMA_PLUGIN("writer_basic", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::BasicWriter, "BasicWriter",
              "Writes images, depth, segmentation, boxes and camera data as "
              "Replicator's BasicWriter does.");
  DIORAMA_ADD_READER(diorama::BasicReader, "BasicReader",
                     "Reads folders of Replicator's BasicWriter: pictures, depth, segmentation, "
                     "boxes, cameras.",
                     "metadata.txt rgb_*.* */rgb/rgb_*.* rgb/*_rgb_*.* camera_params_*.json "
                     "*/*/*.npy */*/*_mapping_*.json *.npy");
}
