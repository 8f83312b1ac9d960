// SPDX-License-Identifier: Apache-2.0
#include "framework/host/standard_streams.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <initializer_list>

namespace diorama {

void claim_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // open() gives the least free number, which is this one. With the opposite mode, use fails.
    const int mode = stream == STDIN_FILENO ? O_WRONLY : O_RDONLY;
    int opened = open("/dev/null", mode);
    if (opened < 0) opened = open("/", O_PATH);
    if (opened != stream) _exit(EXIT_FAILURE);
  }
}

}  // namespace diorama
