// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/builtin_annotators.h"

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/object_coordinates.h"

namespace diorama {

void register_builtin_annotators(Registrar& registrar) {
  add<InstanceIds>(registrar, "instance_ids",
                   "Gives every pixel the id of the nearest labelled node above its surface.");
  add<Instances>(registrar, "instances",
                 "Lists the labelled instances of the scene with pose, bounds and tight box.");
  add<ObjectCoordinates>(registrar, "object_coordinates",
                         "Gives every labelled pixel its place inside its instance's box (NOCS).");
}

}  // namespace diorama
