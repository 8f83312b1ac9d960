// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "value.h"

namespace diorama::usd {

/// What USD's schemas say about a prim type.
struct TypeTraits {
  bool is_known = false;
  bool is_imageable = false;  ///< Has visibility and purpose.
  bool is_xformable = false;  ///< Has transforms.
  bool is_boundable = false;  ///< Has an extent.
  bool is_gprim = false;      ///< A drawn shape.
  bool is_point_based = false;
  bool is_light = false;
};

TypeTraits type_traits(std::string_view type_name);

/// The type that the schema of a prim gives to a primvar; empty when it defines none of this name.
std::string_view schema_attribute_type(const TypeTraits& traits, std::string_view attribute);

/// The API schemas that a prim has: those of its type, then the applied ones with what they bring
/// along. Schemas that USD itself does not define are left out.
Strings api_schemas(std::string_view type_name, const Strings& applied);

}  // namespace diorama::usd
