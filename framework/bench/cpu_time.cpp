// SPDX-License-Identifier: Apache-2.0
#include "framework/bench/cpu_time.h"

#include <sys/resource.h>

namespace diorama::bench {

double cpu_seconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace diorama::bench
