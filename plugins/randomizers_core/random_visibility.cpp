// SPDX-License-Identifier: Apache-2.0
#include "random_visibility.h"

#include "diorama/node_pattern.h"

#include "sampling.h"

namespace diorama {

void RandomVisibility::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to show or hide, with all below them.", kNodePattern});
  v.param("visible_chance", visible_chance,
          {"Probability that a node is shown; a sequence of 1 and 0 shows and hides in turn.", "",
           0, 1});
}

RandomVisibility::RandomVisibility(Params params, Host&) : params_(std::move(params)) {}

void RandomVisibility::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    const double chance = draws.number(params_.visible_chance);
    const bool is_shown = draws.rng.chance(chance);
    if (scene[node].is_visible != is_shown) scene.edit(node).is_visible = is_shown;
  };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, change);
}

}  // namespace diorama
