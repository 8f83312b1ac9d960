// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "embree_renderer.h"

DIORAMA_PLUGIN("renderer_embree", "0.1.0", "Apache-2.0") {
  diorama::add<diorama::EmbreeRenderer>(
      registrar, "embree", "Path-traced pictures and exact labels, on the CPU by Embree.");
}
