// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_basic/basic_writer.h"

DIORAMA_PLUGIN("writer_basic", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::BasicWriter, "BasicWriter",
              "Writes images, depth, segmentation, boxes and camera data as "
              "Replicator's BasicWriter does.");
}
