// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama::bench {

/// CPU seconds of the process so far, all threads, in the program and in the system for it.
double cpu_seconds();

}  // namespace diorama::bench
