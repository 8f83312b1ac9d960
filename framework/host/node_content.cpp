// SPDX-License-Identifier: Apache-2.0
#include "framework/host/node_content.h"

namespace diorama {

void copy_content(const Node& from, Node& to) {
  to.is_visible = from.is_visible;
  to.labels = from.labels;
  to.mesh = from.mesh;
  to.materials = from.materials;
  to.light = from.light;
  to.camera = from.camera;
  to.collider = from.collider;
  to.rigid_body = from.rigid_body;
}

}  // namespace diorama
