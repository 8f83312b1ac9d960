// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Shows assets that move (walkers, fans, waving flags) as they are at a time that is drawn: meshes
/// and poses of all their parts. Bodies of the simulation keep their poses.
class AnimationTime final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/**";
    Distribution share = Range{0.0, 1.0};
    std::optional<Distribution> time_s;
    double frames_per_second = 24.0;

    void visit(ParamVisitor& v);
  };

  AnimationTime(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  std::string draw_name(const Animation& animation, NodeDraws& draws) const;
  void show(Scene& scene, NodeId node, const std::string& name);

  Params params_;
  Host& host_;
};

}  // namespace diorama
