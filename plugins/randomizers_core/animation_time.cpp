// SPDX-License-Identifier: Apache-2.0
#include "animation_time.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>

#include "diorama/error.h"
#include "diorama/joints.h"
#include "diorama/node_pattern.h"
#include "sampling.h"

namespace diorama {

void AnimationTime::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes,
          {"Nodes of assets that move; others that fit are left alone.", kNodePattern});
  v.param("share", share,
          {"Time as a share of the animation, from its start to its end.", "", 0, 1});
  v.param("time_s", time_s,
          {"Time instead, as the asset counts it, kept within the animation.", "s", -1e6, 1e6});
  v.param("frames_per_second", frames_per_second,
          {"Times are rounded to frames of this length; each is loaded once.", "1/s", 0.001, 1000});
}

AnimationTime::AnimationTime(Params params, Host& host) : params_(std::move(params)), host_(host) {}

std::string AnimationTime::draw_name(const Animation& animation, NodeDraws& draws) const {
  const double length = animation.end_s - animation.start_s;
  double time = animation.start_s + draws.number(params_.share) * length;
  if (params_.time_s) time = draws.number(*params_.time_s);
  const double frame = std::round((time - animation.start_s) * params_.frames_per_second);
  time = std::clamp(animation.start_s + frame / params_.frames_per_second, animation.start_s,
                    animation.end_s);
  std::array<char, 512> digits{};  // enough for every number
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), time, std::chars_format::fixed)
          .ptr;
  return animation.asset + "{time=" + std::string(digits.data(), end) + "}";
}

void AnimationTime::show(Scene& scene, NodeId node, const std::string& name) {
  Scene look;
  const NodeId top = host_.load_asset(name, look, look.root());
  const std::string front = scene.path(node);
  const std::size_t prefix = look.path(top).size();
  std::set<NodeId> held;
  for (const NodeId joint : joints_of(scene)) held.insert(scene[joint].joint->child_body);
  for (const NodeId from : look.subtree(top)) {
    const NodeId to = from == top ? node : scene.find(front + look.path(from).substr(prefix));
    if (!to) {
      throw Error(ErrorKind::Asset, front + ": has no part '" + look.path(from).substr(prefix) +
                                        "' as " + name + " has");
    }
    const Node& wanted = look[from];
    if (scene[to].mesh != wanted.mesh) scene.edit(to).mesh = wanted.mesh;
    const bool is_moved = from != top && !scene[to].rigid_body && !held.contains(to) &&
                          scene[to].parent_from_node.matrix() != wanted.parent_from_node.matrix();
    if (is_moved) scene.set_pose(to, wanted.parent_from_node);
  }
}

void AnimationTime::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> nodes =
      match_if(scene, params_.nodes, [](const Node& node) { return node.animation.has_value(); });
  draw_for_each(scene, nodes, context, rng, [&](NodeId node, NodeDraws& draws) {
    show(scene, node, draw_name(*scene[node].animation, draws));
  });
}

}  // namespace diorama
