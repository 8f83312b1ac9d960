// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/lint/dataset_files.h"

/// One function per format; each reads the whole dataset and adds findings.
namespace diorama::lint {

void lint_pose(Dataset& dataset);
void lint_visualization(Dataset& dataset);
void lint_bop(Dataset& dataset);
void lint_webdataset(Dataset& dataset);
void lint_hdf5(Dataset& dataset);

}  // namespace diorama::lint
