// SPDX-License-Identifier: Apache-2.0
#include "framework/app/cli.h"

int main(int argc, char** argv) { return diorama::run_program(argc, argv); }
