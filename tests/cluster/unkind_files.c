// SPDX-License-Identifier: Apache-2.0
// Preloaded into the program; makes its file system slow or faulty. The environment says how:
//
// SLOW_RENAME_MS: every move of a file takes so long. A run then lasts long enough to be disturbed,
// without using the processor.
//
// SLOW_FILES_MS: so does everything that makes, moves, removes or syncs a file or folder, as on a
// network.
//
// FAIL_AT: the operation of that number (1, 2, ...; writes count, too) fails with the error number
// FAIL_ERRNO (default: no space left), and with FAIL_ON=1 every later one as well; FAIL_MARK names
// a file that is made then.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#define REAL(function) ((__typeof__(&function))dlsym(RTLD_NEXT, #function))

static atomic_long operations;

static long number(const char* name, long otherwise) {
  const char* text = getenv(name);
  return text == NULL || *text == '\0' ? otherwise : atol(text);
}

/// True when the operation is to fail; errno is set.
static int disturbed(const char* delay) {
  const long delay_ms = delay == NULL ? 0 : number(delay, 0);
  if (delay_ms > 0) usleep((useconds_t)delay_ms * 1000);
  const long fail_at = number("FAIL_AT", 0);
  if (fail_at <= 0) return 0;
  const long now = atomic_fetch_add(&operations, 1) + 1;
  if (now != fail_at && !(now > fail_at && number("FAIL_ON", 0) == 1)) return 0;
  const char* mark = getenv("FAIL_MARK");
  if (now == fail_at && mark != NULL) close(REAL(open)(mark, O_CREAT | O_WRONLY | O_CLOEXEC, 0666));
  errno = (int)number("FAIL_ERRNO", ENOSPC);
  return 1;
}

static int disturbed_move(void) {
  const long delay_ms = number("SLOW_RENAME_MS", 0);
  if (delay_ms > 0) usleep((useconds_t)delay_ms * 1000);
  return disturbed("SLOW_FILES_MS");
}

int rename(const char* from, const char* to) {
  return disturbed_move() ? -1 : REAL(rename)(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  return disturbed_move() ? -1 : REAL(renameat2)(from_folder, from, to_folder, to, flags);
}

int mkdir(const char* path, mode_t mode) {
  return disturbed("SLOW_FILES_MS") ? -1 : REAL(mkdir)(path, mode);
}

int link(const char* from, const char* to) {
  return disturbed("SLOW_FILES_MS") ? -1 : REAL(link)(from, to);
}

int unlink(const char* path) { return disturbed("SLOW_FILES_MS") ? -1 : REAL(unlink)(path); }

int rmdir(const char* path) { return disturbed("SLOW_FILES_MS") ? -1 : REAL(rmdir)(path); }

int fsync(int file) { return disturbed("SLOW_FILES_MS") ? -1 : REAL(fsync)(file); }

int fdatasync(int file) { return disturbed("SLOW_FILES_MS") ? -1 : REAL(fdatasync)(file); }

/// Files that are made, not those that are read.
int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  if ((flags & O_CREAT) != 0 && disturbed("SLOW_FILES_MS")) return -1;
  return REAL(open)(path, flags, mode);
}

/// Of files; pipes and terminals are not disturbed.
ssize_t write(int file, const void* bytes, size_t count) {
  struct stat status;
  if (fstat(file, &status) == 0 && S_ISREG(status.st_mode) && file > 2 && disturbed(NULL))
    return -1;
  return REAL(write)(file, bytes, count);
}
