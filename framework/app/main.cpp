// SPDX-License-Identifier: Apache-2.0
#include "framework/app/cli.h"
#include "framework/host/standard_streams.h"

int main(int argc, char** argv) {
  diorama::claim_standard_streams();
  return diorama::run_program(argc, argv);
}
