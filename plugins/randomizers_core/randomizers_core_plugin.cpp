// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "dome_light.h"
#include "orbit_cameras.h"
#include "random_colors.h"
#include "random_material.h"
#include "random_visibility.h"
#include "scatter_lights.h"
#include "scatter_poses.h"

DIORAMA_PLUGIN("randomizers_core", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::ScatterPoses, "scatter_poses",
              "Places nodes at random in a box at the working area.");
  DIORAMA_ADD(diorama::ScatterLights, "scatter_lights",
              "Places lights at random in a box at the working area, in random colours.");
  DIORAMA_ADD(diorama::DomeLight, "dome_light", "Picks and turns the sky of dome lights.");
  DIORAMA_ADD(diorama::RandomColors, "random_colors", "Gives every mesh a plain random colour.");
  DIORAMA_ADD(diorama::RandomMaterial, "random_material",
              "Draws roughness and metalness of every mesh's materials.");
  DIORAMA_ADD(diorama::RandomVisibility, "random_visibility", "Shows or hides nodes by chance.");
  DIORAMA_ADD(diorama::OrbitCameras, "orbit_cameras",
              "Places cameras round random targets and looks at them.");
}
