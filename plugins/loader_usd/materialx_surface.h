// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loader_usd/material_draft.h"

namespace diorama::loader_usd {

/// Whether `id` is one of MaterialX's surfaces that are understood: standard surface, OpenPBR,
/// glTF.
bool is_materialx_surface(const std::string& id);

/// Inputs are taken where they are a number, a picture, or something made of one picture: what is
/// computed from it on the way counts for nothing.
void draft_materialx_surface(const usd::Prim& shader, MaterialDraft& draft);

}  // namespace diorama::loader_usd
