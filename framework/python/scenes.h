// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include "diorama/math.h"

namespace diorama {

/// Classes Scene, Node and Rng, and for the plugin `python`: scene_of(capsule "diorama::Scene",
/// capsule "diorama::Host"), whose result ends with its method _end, and rng_of(capsule
/// "diorama::Rng").
void bind_scenes(pybind11::module_& module);

/// Throws Error(Plugin) for a last row of other than 0 0 0 1, which would be lost.
Affine affine_of(const Mat4& matrix);

}  // namespace diorama
