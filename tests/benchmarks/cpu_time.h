// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/resource.h>

namespace diorama::bench {

/// Of the process so far, all threads.
inline double cpu_seconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace diorama::bench
