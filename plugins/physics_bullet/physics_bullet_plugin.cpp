// SPDX-License-Identifier: Apache-2.0
#include "bullet_backend.h"
#include "diorama/plugin.h"

DIORAMA_PLUGIN("physics_bullet", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::BulletBackend, "bullet",
              "Rigid bodies by the Bullet library in double precision.");
}
