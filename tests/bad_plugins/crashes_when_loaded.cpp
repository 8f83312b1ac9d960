// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>

#include "test_writer.h"

namespace {

struct Crash {
  Crash() { std::abort(); }
};
const Crash crash;

}  // namespace

DIORAMA_PLUGIN("crashes_when_loaded", "1.0.0", "MIT") {
  DIORAMA_ADD(diorama::test::QuietWriter, "crashing", "Ends the process when it is loaded.");
}
