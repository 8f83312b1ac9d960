// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_voc/voc_reader.h"
#include "writer_voc/voc_writer.h"

DIORAMA_PLUGIN("writer_voc", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::VocWriter, "VocWriter",
              "Writes Pascal VOC annotations and segmentation pictures.");
  DIORAMA_ADD_READER(diorama::VocReader, "VocReader",
                     "Reads Pascal VOC folders, whoever wrote them: pictures, boxes, masks.",
                     "Annotations/*.xml *.xml");
}
