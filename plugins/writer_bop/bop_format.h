// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// BOP's lengths are millimetres (bop_toolkit, docs/bop_datasets_format.md).
inline constexpr double kMillimetres = 1000.0;
/// Targets of the benchmark are at least this visible.
inline constexpr double kLeastVisibleTarget = 0.1;

}  // namespace diorama
