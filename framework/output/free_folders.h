// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/output/output_store.h"

namespace diorama {

/// Throws Error(Output) when a new dataset would be mixed with files of somebody else: a folder
/// that it writes to holds something, and there is no dataset yet that this could be part of.
/// Hidden files do not count.
void check_folders_are_free(const OutputFolders& folders);

}  // namespace diorama
