// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "diorama/error.h"
#include "path_device.h"
#include "support/catch.h"

namespace diorama::test {

/// Says why where no device of this machine can trace paths; the tests that need one end there.
inline bool has_vulkan_device() {
  try {
    VulkanInstance::of_process().device(0);
    return true;
  } catch (const Error& error) {
    WARN("skipped: " << error.what());
    return false;
  }
}

/// One that is opened for ray queries; null where no device of this machine has them.
inline std::shared_ptr<const PathDevice> ray_query_device() {
  if (!VulkanInstance::of_process().device(0).has_ray_query) return nullptr;
  return shared_path_device(0, true);
}

inline std::shared_ptr<const PathDevice> path_device() { return shared_path_device(0); }

}  // namespace diorama::test
