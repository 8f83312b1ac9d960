// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "denoiser_network.h"

namespace diorama {

/// The network that tests/denoiser_training made; read once, on first use.
const DenoiserNetwork& denoiser_network();

}  // namespace diorama
