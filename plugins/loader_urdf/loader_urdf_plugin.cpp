// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "loader_urdf/urdf_loader.h"

DIORAMA_PLUGIN("loader_urdf", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(diorama::loader_urdf::UrdfLoader, "urdf",
                     "Loads articulated models of robotics (URDF) with their joints.", ".urdf");
}
