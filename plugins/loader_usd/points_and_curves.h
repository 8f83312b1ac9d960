// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/geometry.h"
#include "loader_usd/corner_data.h"
#include "loader_usd/losses.h"

namespace diorama::loader_usd {

struct ThinMesh {
  Mesh mesh;          ///< Without triangles when there is nothing to draw.
  std::string lacks;  ///< Why not, "without widths"; empty when that is no surprise.
  Losses losses;
};

/// Points: a ball for each, as wide as its width; coarser the more there are. `widths` and `colors`
/// may be null.
ThinMesh mesh_of_points(const usd::Stage& stage, const usd::Prim& prim, const CornerData* widths,
                        const CornerData* colors);

/// BasisCurves, linear and cubic: tubes as wide as the curves' widths, with closed ends; coarser
/// the more there are. Normals that would make ribbons of them do not count. `widths` and `colors`
/// may be null.
ThinMesh mesh_of_curves(const usd::Stage& stage, const usd::Prim& prim, const CornerData* widths,
                        const CornerData* colors);

}  // namespace diorama::loader_usd
