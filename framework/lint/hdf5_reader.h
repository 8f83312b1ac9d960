// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "framework/lint/dataset_files.h"

namespace diorama::lint {

/// Reads the data sets at the top of an HDF5 file by the published format (HDF5 File Format
/// Specification 3.0), without the HDF5 library: superblock 0, groups as symbol tables, contiguous
/// or chunked layout, deflate. `descr` is that of NumPy ("<f4", "|u1", "|S12" for text). Throws
/// std::runtime_error that says what is damaged or not understood.
std::map<std::string, NpyArray> read_hdf5(const std::string& file);

}  // namespace diorama::lint
