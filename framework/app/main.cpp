// SPDX-License-Identifier: Apache-2.0
#include <csignal>

#include "framework/app/cli.h"
#include "framework/host/standard_streams.h"

int main(int argc, char** argv) {
  diorama::claim_standard_streams();
  // A limit on the size of files is an error of the write, which says what to do.
  std::signal(SIGXFSZ, SIG_IGN);
  return diorama::run_program(argc, argv);
}
