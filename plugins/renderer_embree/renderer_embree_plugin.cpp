// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "embree_renderer.h"

DIORAMA_PLUGIN("renderer_embree", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::EmbreeRenderer, "embree",
              "Path-traced pictures and exact labels, on the CPU by Embree.");
}
