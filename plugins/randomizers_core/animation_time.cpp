// SPDX-License-Identifier: Apache-2.0
#include "animation_time.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "diorama/error.h"
#include "diorama/joints.h"
#include "diorama/node_pattern.h"
#include "loader_support/asset_name.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kAtEnd[] = {"repeat", "ping_pong", "hold"};

/// What another time makes anew without a change: renderers would take it for another mesh.
bool is_same(const std::shared_ptr<const Mesh>& a, const std::shared_ptr<const Mesh>& b) {
  if (a == b || !a || !b) return a == b;
  return a->positions == b->positions && a->triangles == b->triangles && a->normals == b->normals &&
         a->uvs == b->uvs && a->colors == b->colors && a->material_slots == b->material_slots &&
         a->is_double_sided == b->is_double_sided;
}

}  // namespace

void AnimationTime::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes,
          {"Nodes of assets that move; others that fit are left alone.", kNodePattern});
  v.param(
      "animation", animation,
      {"Name or number (from 0) of the animation, of files that hold several; the first, or the "
       "one that the asset's name asks for, where nothing is said. `diorama inspect` lists them."});
  v.param("share", share,
          {"Time as a share of the animation, from its start to its end.", "", 0, 1});
  v.param("time_s", time_s,
          {"Time instead, as the asset counts it, kept within the animation.", "s", -1e6, 1e6});
  v.param("frames_per_second", frames_per_second,
          {"Times drawn are rounded to frames of this length; each is loaded once.", "1/s", 0.001,
           1000});
  v.param("speed", speed,
          {"In a clip: seconds of the animation per second, from the time drawn on; below 0 "
           "backwards, 0 stands still.",
           "", -1000, 1000});
  v.choice(
      "at_end", at_end, kAtEnd,
      {"In a clip, where the animation ends: begins again, goes back, or keeps its last pose."});
}

AnimationTime::AnimationTime(Params params, Host& host) : params_(std::move(params)), host_(host) {}

void AnimationTime::choose(Scene& scene, NodeId node, const std::string& animation) {
  const std::string name =
      loader_support::named_with(scene[node].animation->asset, "animation", animation);
  if (name == scene[node].animation->asset) return;
  auto known = known_.find(name);
  if (known == known_.end()) {
    Scene look;
    const NodeId top = host_.load_asset(name, look, look.root());
    if (!look[top].animation) throw Error(ErrorKind::Asset, name + ": does not move");
    known = known_.emplace(name, *look[top].animation).first;
  }
  scene.edit(node).animation = known->second;
}

double AnimationTime::draw_time(const Animation& animation, NodeDraws& draws) const {
  const double length = animation.end_s - animation.start_s;
  double time = animation.start_s + draws.number(params_.share) * length;
  if (params_.time_s) time = draws.number(*params_.time_s);
  const double frame = std::round((time - animation.start_s) * params_.frames_per_second);
  return std::clamp(animation.start_s + frame / params_.frames_per_second, animation.start_s,
                    animation.end_s);
}

/// Not rounded: what moves in steps looks as if it stumbled.
double AnimationTime::time_at(const Animation& animation, const Playing& playing,
                              double clip_s) const {
  const double length = animation.end_s - animation.start_s;
  double gone = playing.time_s - animation.start_s + playing.speed * clip_s;
  if (clip_s > 0.0 && length > 0.0 && params_.at_end != "hold") {
    const double period = params_.at_end == "ping_pong" ? 2.0 * length : length;
    gone -= std::floor(gone / period) * period;
    if (gone > length) gone = period - gone;
  }
  return animation.start_s + std::clamp(gone, 0.0, length);
}

void AnimationTime::show(Scene& scene, NodeId node, double time_s) {
  const std::string name = loader_support::named_at(scene[node].animation->asset, time_s);
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
    if (!is_same(scene[to].mesh, wanted.mesh)) scene.edit(to).mesh = wanted.mesh;
    const bool is_moved = from != top && !scene[to].rigid_body && !held.contains(to) &&
                          scene[to].parent_from_node.matrix() != wanted.parent_from_node.matrix();
    if (is_moved) scene.set_pose(to, wanted.parent_from_node);
  }
}

void AnimationTime::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const std::vector<NodeId> nodes =
      match_if(scene, params_.nodes, [](const Node& node) { return node.animation.has_value(); });
  playing_.clear();
  const std::vector<std::string>& animations = params_.animation.texts();
  draw_for_each(scene, nodes, context, rng, [&](NodeId node, NodeDraws& draws) {
    if (!animations.empty()) choose(scene, node, animations[draws.text(params_.animation)]);
    const Playing& playing = playing_.emplace_back(
        Playing{node, draw_time(*scene[node].animation, draws), draws.number(params_.speed)});
    show(scene, node, playing.time_s);
  });
}

void AnimationTime::lead(Scene& scene, const ClipFrame& frame) {
  for (const Playing& playing : playing_) {
    if (!scene.contains(playing.node) || playing.speed == 0.0) continue;
    show(scene, playing.node, time_at(*scene[playing.node].animation, playing, frame.time_s()));
  }
}

}  // namespace diorama
