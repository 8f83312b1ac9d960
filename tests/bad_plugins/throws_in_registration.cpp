// SPDX-License-Identifier: Apache-2.0
#include <stdexcept>

#include "test_writer.h"

DIORAMA_PLUGIN("throws_in_registration", "1.0.0", "MIT") {
  DIORAMA_ADD(diorama::test::QuietWriter, "never", "Is never registered.");
  throw std::runtime_error("no licence file");
}
