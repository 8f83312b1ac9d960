// SPDX-License-Identifier: Apache-2.0
#include "scatter_lights.h"

#include "diorama/node_pattern.h"

#include <cmath>

#include "diorama/obstacles.h"
#include "sampling.h"

namespace diorama {
namespace {

bool is_placeable(const Node& node) {
  return node.light && node.light->kind != LightKind::Dome &&
         node.light->kind != LightKind::Distant;
}

/// How far the light reaches from its middle.
double reach_of(const Light& light) {
  if (light.kind == LightKind::Rect) return 0.5 * std::hypot(light.width_m, light.height_m);
  return light.radius_m;
}

/// The visible things of a scene, for lights.
struct Surroundings {
  Obstacles all;
  Obstacles environment;
  Vec3 air_world;  ///< A point that lights shall reach.

  Surroundings(const Scene& scene, const Vec3& working_area_world)
      : all(scene, "/**"),
        environment(scene, "/Environment/**"),
        air_world(working_area_world + Vec3::UnitZ()) {}

  /// Larger is better; a free place is `wanted_m` or more.
  double quality(const Vec3& place, double wanted_m) const {
    if (all.encloser(place)) return -2.0;
    const double distance = all.distance(place, wanted_m);
    return environment.is_between(place, air_world) ? distance / wanted_m - 2.0 : distance;
  }
};

}  // namespace

void ScatterLights::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Lights to place.", kNodePattern});
  v.param("offset", offset, {"Place, from the working area along the world's axes.", "m"}, 3);
  v.param("color", color, {"Red, green and blue, linear.", "", 0, 1}, 3);
  v.param("intensity", intensity,
          {"Luminance of the light's surface for white, as in Replicator.", "nit", 0, 1e9});
  v.param("radius_m", radius_m,
          {"Radius of sphere and disk lights; null keeps what they have.", "m", 0, 1000});
  v.param("clearance_m", clearance_m,
          {"Nothing visible is nearer to the light's surface, and no wall stands between the light "
           "and the working area; 0 takes every place.",
           "m", 0, 100});
  v.param("max_tries", max_tries, {"Draws per light at most.", "", 1, 10000});
}

ScatterLights::ScatterLights(Params params, Host&) : params_(std::move(params)) {}

void ScatterLights::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const bool is_choosy = params_.clearance_m > 0.0;
  std::optional<Surroundings> surroundings;
  if (is_choosy) surroundings.emplace(scene, context.working_area_world);
  const auto draw_place = [&](NodeDraws& draws) -> Vec3 {
    return context.working_area_world + draws.vector(params_.offset);
  };
  const auto change = [&](NodeId node, NodeDraws& draws) {
    const Rng again = draws.rng.fork("again");
    Vec3 place = draw_place(draws);
    Light& light = *scene.edit(node).light;
    const Vec3 color = draws.vector(params_.color);
    light.color = (draws.number(params_.intensity) * color).cast<float>();
    if (params_.radius_m) light.radius_m = draws.number(*params_.radius_m);
    if (is_choosy) {
      const double wanted_m = params_.clearance_m + reach_of(light);
      double best = surroundings->quality(place, wanted_m);
      for (int i = 1; best < wanted_m && i < params_.max_tries; ++i) {
        NodeDraws more{again.fork(std::uint64_t(i)), draws.index};
        const Vec3 other = draw_place(more);
        const double quality = surroundings->quality(other, wanted_m);
        if (quality <= best) continue;
        best = quality;
        place = other;
      }
    }
    Affine pose = scene.world_from_node(node);
    pose.translation() = place;
    set_world_pose(scene, node, pose);
  };
  draw_for_each(scene, match_if(scene, params_.nodes, is_placeable), context, rng, change);
}

}  // namespace diorama
