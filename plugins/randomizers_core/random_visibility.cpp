// SPDX-License-Identifier: Apache-2.0
#include "random_visibility.h"

namespace diorama {

void RandomVisibility::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to show or hide, with all below them."});
  v.param("visible_chance", visible_chance, {"Probability that a node is shown.", "", 0, 1});
}

RandomVisibility::RandomVisibility(Params params, Host&) : params_(std::move(params)) {}

void RandomVisibility::randomize(Scene& scene, const RandomizeContext&, const Rng& rng) {
  for (const NodeId node : scene.match(params_.nodes)) {
    const bool is_shown = rng.fork(scene.path(node)).chance(params_.visible_chance);
    if (scene[node].is_visible != is_shown) scene.edit(node).is_visible = is_shown;
  }
}

}  // namespace diorama
