// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// Exit codes that are no errors (framework/docs/exit_codes.md); errors have those of exit_code().

inline constexpr int kDatasetIncomplete = 8;  ///< `status` and `finish`: captures are missing.
inline constexpr int kBusy = 75;              ///< Another process has this part; later it is free.
inline constexpr int kStopped = 130;          ///< A signal came before the end.

}  // namespace diorama
