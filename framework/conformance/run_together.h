// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace diorama::conformance {

/// Runs work(0), work(1), ... each on a thread of its own. None begins before all threads run, so
/// that what they share they do share. Returns when all are done; throws the error of the first
/// thread that failed.
void run_together(int threads, const std::function<void(int)>& work);

}  // namespace diorama::conformance
