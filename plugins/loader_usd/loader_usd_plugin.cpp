// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "loader_usd/usd_loader.h"

DIORAMA_PLUGIN("loader_usd", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(diorama::loader_usd::UsdLoader, "usd", "Loads USD scenes and assets.",
                     ".usd .usda .usdc .usdz =PXR-USDC =#usda =#sdf =PK");
}
