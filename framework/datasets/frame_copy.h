// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/frame.h"

namespace diorama {

/// Everything but the channels that are not among `channels`. Frames are otherwise only moved, as
/// their pictures are large.
Frame copy_of(const Frame& frame, const NameSet& channels);

/// With all its channels.
Frame copy_of(const Frame& frame);

}  // namespace diorama
