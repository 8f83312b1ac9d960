// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_webdataset/webdataset_reader.h"
#include "writer_webdataset/webdataset_writer.h"

DIORAMA_PLUGIN("writer_webdataset", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::WebDatasetWriter, "WebDatasetWriter",
              "Writes tar shards for WebDataset, one per capture or of a chosen size.");
  DIORAMA_ADD_READER(diorama::WebDatasetReader, "WebDatasetReader",
                     "Reads tar shards of WebDataset, whoever wrote them.",
                     "*.tar */*.tar *.tar.gz */*.tar.gz *.tgz */*.tgz");
}
