// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/scene.h"

/// Whether what a scene shows can be believed, by its visible triangles alone: no engine is asked,
/// so that the check is independent of what placed and moved the objects.
namespace diorama {

class Room;
struct LastStep;

/// A thing and what is wrong with it, in words that follow its name: "hangs in the air".
struct Flaw {
  NodeId node;
  std::string why;
};

struct SettleLimits {
  double rest_speed = 0.05;  ///< m/s; slower is at rest.
  double reach_m = 0.01;     ///< What is nearer than this below holds.
  double depth_m = 0.01;     ///< Crossed deeper than this is stuck; thin things at a third.
};

/// Objects that are no picture of things at rest: outside the room, moving, in the air with
/// nothing that stands below them, or crossed by something deep inside. What floats (without
/// gravity) may hang and drift. Each object once, in the order given.
std::vector<Flaw> find_unsettled(const Scene& scene, const Room& room,
                                 const std::vector<NodeId>& objects, const LastStep& last,
                                 const SettleLimits& limits);

/// Those of the `asked` objects that something crosses deep inside.
std::vector<Flaw> find_stuck(const Scene& scene, const std::vector<NodeId>& objects,
                             const std::vector<NodeId>& asked, const SettleLimits& limits);

/// Objects that touch or stand inside something, hidden or not.
std::vector<Flaw> find_born_inside(const Scene& scene, const std::vector<NodeId>& objects);

/// Cameras inside something solid, or with something visible before their near plane's distance.
std::vector<Flaw> find_blocked_cameras(const Scene& scene, const std::vector<NodeId>& cameras);

}  // namespace diorama
