// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/plugin.h"

namespace diorama {

/// Registers `instance_ids`, `instances` and `object_coordinates`. What they need of each other
/// stands in their needs() and provides(), so that any order of registration will do.
void register_builtin_annotators(Registrar& registrar);

}  // namespace diorama
