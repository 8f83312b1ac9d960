// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_video/video_writer.h"

DIORAMA_PLUGIN("writer_video", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::VideoWriter, "VideoWriter",
              "Makes an MP4 of every clip, all cameras side by side, for people to look at.");
}
