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

/// Linear RGB of a black body, of luminance 1; 6500 K is white, as UsdLux has it. Places on the
/// Planckian locus by Kim et al. (US patent 7024034), good from 1667 to 25000 K.
Vec3 planckian_rgb(double kelvin) {
  const double t = 1000.0 / kelvin;
  const double x = kelvin < 4000.0 ? 0.179910 + t * (0.8776956 + t * (-0.2343589 - t * 0.2661239))
                                   : 0.240390 + t * (0.2226347 + t * (2.1070379 - t * 3.0258469));
  double y = 0.0;
  if (kelvin < 2222.0) {
    y = -0.20219683 + x * (2.18555832 + x * (-1.34811020 - x * 1.1063814));
  } else if (kelvin < 4000.0) {
    y = -0.16748867 + x * (2.09137015 + x * (-1.37418593 - x * 0.9549476));
  } else {
    y = -0.37001483 + x * (3.75112997 + x * (-5.87338670 + x * 3.0817580));
  }
  const Vec3 xyz(x / y, 1.0, (1.0 - x - y) / y);
  Mat3 rgb_from_xyz;
  rgb_from_xyz << 3.2404542, -1.5371385, -0.4985314, -0.9692660, 1.8760108, 0.0415560, 0.0556434,
      -0.2040259, 1.0572252;
  return (rgb_from_xyz * xyz).cwiseMax(0.0);
}

Vec3 blackbody_color(double kelvin) {
  const Vec3 color = planckian_rgb(kelvin).cwiseQuotient(planckian_rgb(6500.0));
  return color / color.dot(Vec3(0.2126, 0.7152, 0.0722));
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
  v.param("temperature_k", temperature_k,
          {"Colour temperature that tints the colour: 6500 is white, less is warmer; null: none.",
           "K", 1667, 25000});
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
    if (params_.temperature_k) {
      const Vec3 tint = blackbody_color(draws.number(*params_.temperature_k));
      light.color = light.color.cwiseProduct(tint.cast<float>());
    }
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
