// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/error.h"

namespace diorama::test {

/// Text of the diorama::Error that `action` throws; "(no error)" when it throws none.
template <class Action>
std::string error_text(Action&& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "(no error)";
}

}  // namespace diorama::test
