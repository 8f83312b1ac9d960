// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "loader_assimp/assimp_loader.h"

DIORAMA_PLUGIN("loader_assimp", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(diorama::loader_assimp::AssimpLoader, "assimp",
                     "Loads glTF, OBJ, FBX, COLLADA, PLY, STL and more.", DIORAMA_ASSIMP_CLAIMS);
}
