// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/error.h"

namespace diorama {

/// The program: reads the command line, runs one command, reports an error as one message on
/// stderr. Returns the exit code (framework/docs/exit_codes.md). Throws nothing.
int run_program(int argc, const char* const* argv);

/// The exit code for an error.
int exit_code(ErrorKind kind);

}  // namespace diorama
