// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loader_usd/material_draft.h"

namespace diorama::loader_usd {

/// The module that a shader names: `OmniPBR.mdl`.
std::string mdl_module(const ShaderNetwork& network, const usd::Prim& shader);

/// MDL itself is not read: a shader is taken by the names of its common inputs.
void draft_mdl_surface(const usd::Prim& shader, MaterialDraft& draft);

}  // namespace diorama::loader_usd
