// SPDX-License-Identifier: Apache-2.0
#include "diorama/error.h"

namespace diorama {

Error::Error(ErrorKind kind, const std::string& text) : std::runtime_error(text), kind_(kind) {}
Error::~Error() = default;

}  // namespace diorama
