// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "diorama/scene.h"

namespace diorama {

/// How far from a lamp its brightness is compared, metres: a table below a ceiling lamp.
inline constexpr double kLampDistance = 2.0;

/// What a sky of 1000 nits, the brightness that randomizers give it, shines on open ground, in lux.
inline constexpr double kSkyLux = 1000.0 * kPi;

/// Illuminance at kLampDistance in front of the node's own light and glowing mesh, in lux, pictures
/// on them taken as white. Zero for domes and distant lights, which have no place.
double lamp_lux(const Scene& scene, NodeId node);

struct DimmedLamps {
  std::size_t count = 0;
  double brightest_lux = 0.0;  ///< Before.
};
/// Dims the visible lamps at `top` and below that are brighter than that to this illuminance.
/// Materials are shared: glowing ones that are dimmed become new ones.
DimmedLamps dim_lamps(Scene& scene, NodeId top, double most_lux);

}  // namespace diorama
