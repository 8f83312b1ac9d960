// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "matrix.h"
#include "stage.h"

namespace diorama::usd {

/// The box of a boundable prim in its own space: the authored extent or, where there is none, what
/// follows from the other attributes of shapes, points, curves, instancers and skeletons. Nothing
/// for prims that have neither.
std::optional<Box> local_extent(Stage& stage, const Prim& prim);

/// Instance transforms of a PointInstancer, prototype transform included, with the prototype's
/// prim. Masked instances and those without a prototype are left out.
struct PointInstance {
  const Prim* prototype = nullptr;
  Matrix instancer_from_prototype;
};
struct PointInstances {
  std::vector<PointInstance> list;
  bool lacks_prototypes = false;  ///< Some are of prototypes that are not there.
  bool lacks_positions = false;   ///< There are fewer positions than instances.
};
PointInstances point_instances(Stage& stage, const Prim& instancer);

}  // namespace diorama::usd
