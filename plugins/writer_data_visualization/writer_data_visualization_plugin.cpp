// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_data_visualization/data_visualization_reader.h"
#include "writer_data_visualization/data_visualization_writer.h"

DIORAMA_PLUGIN("writer_data_visualization", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::DataVisualizationWriter, "DataVisualizationWriter",
              "Draws boxes over the pictures, as Replicator's DataVisualizationWriter does; also "
              "masks, distances and motion.");
  DIORAMA_ADD_READER(diorama::DataVisualizationReader, "DataVisualizationReader",
                     "Checks folders of Replicator's DataVisualizationWriter.",
                     "metadata.txt */*_fast_*.png");
}
