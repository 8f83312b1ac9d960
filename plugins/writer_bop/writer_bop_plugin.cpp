// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_bop/bop_writer.h"

DIORAMA_PLUGIN("writer_bop", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::BopWriter, "BopWriter",
              "Writes 6-D object poses, masks and depth in the BOP format.");
}
