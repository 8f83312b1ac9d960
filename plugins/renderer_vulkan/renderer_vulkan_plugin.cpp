// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "vulkan_renderer.h"

DIORAMA_PLUGIN("renderer_vulkan", "0.1.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::VulkanRenderer, "vulkan",
              "Path-traced pictures on a GPU by Vulkan, and exact labels by Embree.");
}
