// SPDX-License-Identifier: Apache-2.0
// Preloaded into the program: every rename takes SLOW_RENAME_MS milliseconds, as on a busy network file
// system. A run then lasts long enough to be disturbed, without using the processor.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <unistd.h>

typedef int rename_function(const char*, const char*);

int rename(const char* from, const char* to) {
  static rename_function* real = NULL;
  if (real == NULL) real = (rename_function*)dlsym(RTLD_NEXT, "rename");
  const char* delay_ms = getenv("SLOW_RENAME_MS");
  if (delay_ms != NULL) usleep((useconds_t)atoi(delay_ms) * 1000);
  return real(from, to);
}
