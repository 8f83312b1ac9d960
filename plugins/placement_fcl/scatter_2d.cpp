// SPDX-License-Identifier: Apache-2.0
#include "scatter_2d.h"

#include "diorama/node_pattern.h"

#include "surface_points.h"

namespace diorama {

void Scatter2d::Params::visit(ParamVisitor& v) {
  placement.visit(v);
  v.param("surfaces", surfaces, {"Nodes whose meshes are scattered on.", kNodePattern});
  v.param("max_slope_deg", max_slope_deg, {"Faces steeper than this are left out.", "deg", 0, 89});
  v.param("gap_m", gap_m, {"Height of the node's underside above the surface.", "m", 0, 100});
}

Scatter2d::Scatter2d(Params params, Host& host) : params_(std::move(params)), host_(host) {}

void Scatter2d::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  if (scene.match(params_.placement.nodes).empty()) return;
  const SurfacePoints points(scene, params_.surfaces, params_.max_slope_deg * kPi / 180.0);
  if (points.is_empty()) {
    host_.log(LogLevel::Warning, "'surfaces': nothing that fits '" + params_.surfaces +
                                     "' is visible and faces upwards, so nothing is placed");
    return;
  }
  const auto draw = [&](const Aabb& box, Rng& draws) -> Vec3 {
    Vec3 underside = box.centre();
    underside.z() = box.min.z();
    const double gap = params_.gap_m.draw(draws, std::uint64_t(context.occurrence));
    return points.draw(draws) + gap * Vec3::UnitZ() - underside;
  };
  place_freely(params_.placement, draw, rng, scene, host_);
}

}  // namespace diorama
