// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

#include "diorama/host.h"

namespace diorama {

/// Where messages go; may be called from any thread.
using Log = std::function<void(LogLevel level, std::string_view message)>;

}  // namespace diorama
