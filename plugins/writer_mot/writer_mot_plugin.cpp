// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_mot/mot_reader.h"
#include "writer_mot/mot_writer.h"

DIORAMA_PLUGIN("writer_mot", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::MotWriter, "MotWriter",
              "Writes clips as MOT Challenge sequences: pictures, tracks, seqinfo.ini.");
  DIORAMA_ADD_READER(diorama::MotReader, "MotReader",
                     "Reads MOT Challenge folders, whoever wrote them: pictures, boxes, tracks.",
                     "*/gt/gt.txt */*/gt/gt.txt */seqinfo.ini */*/seqinfo.ini");
}
