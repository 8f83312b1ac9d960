// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/lint/dataset_files.h"

/// Formats that no reader knows: one function each reads the whole dataset and adds findings.
namespace diorama::lint {

void lint_visualization(Dataset& dataset);

}  // namespace diorama::lint
