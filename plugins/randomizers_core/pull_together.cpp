// SPDX-License-Identifier: Apache-2.0
#include "pull_together.h"

#include "diorama/node_pattern.h"
#include "sampling.h"

namespace diorama {

void PullTogether::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Rigid bodies to send.", kNodePattern});
  v.param("strength", strength,
          {"Speed as a share of the distance: at 1 a body would be there in a second.", "1/s", -1e3,
           1e3});
}

PullTogether::PullTogether(Params params, Host&) : params_(std::move(params)) {}

void PullTogether::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    const Vec3 way = context.working_area_world - scene.world_from_node(node).translation();
    const Vec3 linear = draws.number(params_.strength) * way;
    scene.set_velocity(node, linear, scene[node].rigid_body->angular_velocity);
  };
  const auto is_body = [](const Node& node) { return node.rigid_body.has_value(); };
  draw_for_each(scene, match_if(scene, params_.nodes, is_body), context, rng, change);
}

}  // namespace diorama
