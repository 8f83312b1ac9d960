// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/export/integer_coding.h"
#include "framework/export/usd_layer.h"

namespace diorama::usd_export {

/// The layer as a crate file ("usdc"), version 0.8.0, which every USD since 2019 reads. Equal
/// values are stored once.
Bytes write_crate(const Layer& layer);

}  // namespace diorama::usd_export
