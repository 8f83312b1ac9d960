// SPDX-License-Identifier: Apache-2.0
#include "test_writer.h"

DIORAMA_PLUGIN("well_behaved", "1.2.3", "MIT") {
  DIORAMA_ADD(diorama::test::QuietWriter, "quiet", "Writes nothing.");
}
