// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/error.h"
#include "support/catch.h"
#include "vulkan_instance.h"

namespace diorama::test {

/// Says why where no device of this machine can trace paths; the tests that need one end there.
inline bool has_vulkan_device() {
  try {
    VulkanInstance().device(0);
    return true;
  } catch (const Error& error) {
    WARN("skipped: " << error.what());
    return false;
  }
}

}  // namespace diorama::test
