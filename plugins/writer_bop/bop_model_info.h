// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include "diorama/math.h"
#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// The extent of a model by obj_id, millimetres: what models_info.json says.
using BopModelBoxes = std::map<int, Aabb>;

/// Reads it from the first folder of models that has one; nothing when there is none. Of a dataset
/// with a page of ours models must be there, as large as the table says, and look the same by their
/// symmetries.
BopModelBoxes read_bop_models(StoredFiles& files, const std::optional<DatasetPage>& own);

std::string bop_model_file(int id);  ///< "models/obj_000001.ply"

}  // namespace diorama
