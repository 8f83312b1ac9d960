// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "diorama/params.h"

/// Parameters whose own keys depend on their neighbours: those of a class that `file` and `class`
/// name. Such a one is of type Any, and each of its children a group whose `choices` say when it is
/// meant: "class=Circle". Where none is, any value is right as far as the host knows.
namespace diorama {

/// Keys of the neighbours and their values.
std::vector<std::pair<std::string, std::string>> conditions_of(const ParamSpec& variant);

/// The child of `spec` whose conditions hold in `map`, in which the parameter stands; null: none.
const ParamSpec* variant_of(const ParamSpec& spec, const Value& map);

}  // namespace diorama
