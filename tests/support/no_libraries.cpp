// SPDX-License-Identifier: Apache-2.0
#include "diorama/error.h"
#include "framework/plugins/on_demand_library.h"

namespace diorama {

// For fuzzers, which have the codecs of the project alone: headers are looked at, OpenCV is not
// asked.
void* on_demand_function(const std::string& name, const char*) {
  throw Error(ErrorKind::Plugin, name + ".so: is no part of this program");
}

}  // namespace diorama
