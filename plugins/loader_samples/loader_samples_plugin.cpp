// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "loader_samples/samples_loader.h"

DIORAMA_PLUGIN("loader_samples", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(diorama::samples::SamplesLoader, "samples",
                     "Makes the objects, props and skies of the sample pack.",
                     "sample: prop: sky:");
}
