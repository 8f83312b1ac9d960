// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loader_usd/material_draft.h"

namespace diorama::loader_usd {

/// Whether `id` is the preview surface, as USD or as MaterialX calls it.
bool is_preview_surface(const std::string& id);

void draft_preview_surface(const usd::Prim& shader, MaterialDraft& draft);

}  // namespace diorama::loader_usd
