// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "framework/pipeline/settle_check.h"

/// What holds what in a scene and what stands in what, by points spread over the visible surfaces
/// and by the surfaces that rays cross. Shares nothing with what placed, moved and judged the
/// objects of a run (physics, Obstacles, find_unsettled()), so that it can contradict them.
namespace diorama {

struct SupportLimits {
  double reach_m = 0.011;  ///< What is farther from an object's points does not hold it.
  double depth_m = 0.012;  ///< Points deeper than this inside of another thing are stuck.
};

struct JudgedObject {
  NodeId node;
  bool falls = true;  ///< What does not may hang in the air.
};

/// Objects that are stuck inside of something closed, or fall and are held by nothing: neither by
/// what is no falling object nor by one that is held. Each once, in the order given. What spans
/// more than half of `environment` in both directions of the floor is a room, in which things may
/// be; null: nothing is.
std::vector<Flaw> find_unheld(const Scene& scene, NodeId environment,
                              const std::vector<JudgedObject>& objects,
                              const SupportLimits& limits = {});

/// A camera and what may not be nearer to it.
struct JudgedCamera {
  Vec3 place = Vec3::Zero();  ///< World.
  double near_m = 0.0;
};

/// Of each camera what blocks it, in words that follow its name: "stands in /Environment/lamp";
/// empty: nothing. Things open to some sides have an inside, too: whatever fills most of the
/// directions from a place within its box. Rooms as in find_unheld().
std::vector<std::string> find_blocked(const Scene& scene, NodeId environment,
                                      const std::vector<JudgedCamera>& cameras);

}  // namespace diorama
