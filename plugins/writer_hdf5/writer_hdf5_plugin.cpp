// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_hdf5/hdf5_reader.h"
#include "writer_hdf5/hdf5_writer.h"

DIORAMA_PLUGIN("writer_hdf5", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::Hdf5Writer, "Hdf5Writer",
              "Writes one HDF5 file per picture, laid out as BlenderProc does.");
  DIORAMA_ADD_READER(diorama::Hdf5Reader, "Hdf5Reader",
                     "Reads HDF5 files, one per picture, with the names of BlenderProc.",
                     "*.hdf5 *.h5 */*.hdf5 */*.h5");
}
