// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Parameters that both ways of scattering share.
struct PlacementParams {
  std::string nodes = "/Assets/*";
  bool avoid_overlap = true;
  std::vector<std::string> obstacles{"/Environment/**", "/Assets/*", "/Distractors/*/*"};
  int max_tries = 100;

  void visit(ParamVisitor& v);
};

/// Where the node with this box in the world (empty: its place alone) goes: how far it is moved.
using DrawShift = std::function<Vec3(const Aabb& box_world, Rng& rng)>;

/// Moves the nodes, one after the other, to places that `draw` gives and where they meet neither
/// obstacles nor each other. When none of params.max_tries places is free, the last one stands and
/// a warning names the node.
void place_freely(const PlacementParams& params, const DrawShift& draw, const Rng& rng,
                  Scene& scene, Host& host);

}  // namespace diorama
