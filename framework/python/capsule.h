// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <cstring>

#include "diorama/error.h"

namespace diorama {

/// What the plugin `python` has put into a capsule of that name.
template <class T>
T* held(const pybind11::capsule& capsule, const char* name) {
  if (capsule.name() == nullptr || std::strcmp(capsule.name(), name) != 0) {
    throw Error(ErrorKind::Internal, std::string("expected a capsule ") + name);
  }
  return capsule.get_pointer<std::remove_const_t<T>>();
}

}  // namespace diorama
