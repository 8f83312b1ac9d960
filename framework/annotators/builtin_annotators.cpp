// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/builtin_annotators.h"

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/object_coordinates.h"

namespace diorama {

void register_builtin_annotators(Registrar& registrar) {
  add<InstanceIds>(registrar, "instance_ids",
                   "Gives every pixel the id of the nearest labelled node above its surface.",
                   {"", "leaf_id", "instance_id"});
  add<Instances>(registrar, "instances",
                 "Lists the labelled instances of the scene with pose, bounds and tight box.",
                 {"", "instance_id", "instances"});
  add<ObjectCoordinates>(registrar, "object_coordinates",
                         "Gives every labelled pixel its place inside its instance's box (NOCS).",
                         {"", "instance_id position instances", "object_coordinates"});
}

}  // namespace diorama
