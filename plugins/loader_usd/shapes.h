// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "diorama/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// The attributes that decide what a shape looks like.
inline constexpr const char* kShapeAttributes[] = {"size",   "radius", "radiusTop", "radiusBottom",
                                                   "height", "axis",   "width",     "length"};

/// Cube, Sphere, Cylinder, Cone, Capsule and Plane, in stage units. Nothing for prims of another
/// type and for shapes without a size.
std::optional<Mesh> make_shape(const usd::Stage& stage, const usd::Prim& prim);

}  // namespace diorama::loader_usd
