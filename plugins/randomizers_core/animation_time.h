// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Shows assets that move (walkers, fans, waving flags) as they are at a time that is drawn: meshes
/// and poses of all their parts. In a clip they go on from there. Bodies of the simulation keep
/// their poses.
class AnimationTime final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/**";
    TextDistribution animation;
    Distribution share = Range{0.0, 1.0};
    std::optional<Distribution> time_s;
    double frames_per_second = 24.0;
    Distribution speed = 1.0;
    std::string at_end = "repeat";

    void visit(ParamVisitor& v);
  };

  AnimationTime(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;
  void lead(Scene& scene, const ClipFrame& frame) override;

 private:
  /// An asset that was given a time at the last moment.
  struct Playing {
    NodeId node;
    double time_s = 0.0;  ///< That was drawn.
    double speed = 1.0;
  };
  void choose(Scene& scene, NodeId node, const std::string& animation);
  double draw_time(const Animation& animation, NodeDraws& draws) const;
  double time_at(const Animation& animation, const Playing& playing, double clip_s) const;
  void show(Scene& scene, NodeId node, double time_s);

  Params params_;
  Host& host_;
  std::vector<Playing> playing_;
  std::map<std::string, Animation> known_;  ///< By the names of assets that were chosen.
};

}  // namespace diorama
