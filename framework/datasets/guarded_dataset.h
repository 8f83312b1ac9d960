// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "diorama/reader.h"

namespace diorama {

/// The same dataset, whose read() makes a finding of what the reader throws: that capture has its
/// number and no frames, all others are as they are. Stopped and memory shortage pass.
std::unique_ptr<const StoredDataset> guarded(std::unique_ptr<const StoredDataset> dataset);

}  // namespace diorama
