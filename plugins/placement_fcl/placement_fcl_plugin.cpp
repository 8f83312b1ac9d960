// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "scatter_2d.h"
#include "scatter_3d.h"

DIORAMA_PLUGIN("placement_fcl", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::Scatter2d, "scatter_2d",
              "Sets nodes onto surfaces without meeting each other or the room.");
  DIORAMA_ADD(diorama::Scatter3d, "scatter_3d",
              "Puts nodes into a volume without meeting each other or the room.");
}
