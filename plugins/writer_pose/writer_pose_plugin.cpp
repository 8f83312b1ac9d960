// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_pose/pose_reader.h"
#include "writer_pose/pose_writer.h"

DIORAMA_PLUGIN("writer_pose", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::PoseWriter, "PoseWriter",
              "Writes object poses and cuboid keypoints as Replicator's "
              "PoseWriter does; DOPE, CenterPose.");
  DIORAMA_ADD_READER(diorama::PoseReader, "PoseReader",
                     "Reads object poses as Replicator's PoseWriter stores them.",
                     "metadata.txt *.json rp_*/*.json");
}
