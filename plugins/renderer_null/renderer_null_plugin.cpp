// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "null_renderer.h"

DIORAMA_PLUGIN("renderer_null", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::NullRenderer, "null",
              "Exact labels and flat colours without light, for tests and dry runs.");
}
