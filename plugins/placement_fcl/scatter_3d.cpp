// SPDX-License-Identifier: Apache-2.0
#include "scatter_3d.h"

#include "diorama/node_pattern.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diorama/error.h"

namespace diorama {
namespace {

/// The box of a node, in the node's own space, so that a turned box stays a box.
struct Volume {
  Aabb box_node;
  Affine world_from_node;
  double cubic_metres = 0.0;

  bool holds(const Vec3& point_world) const {
    const Vec3 point = world_from_node.inverse() * point_world;
    return (point.array() >= box_node.min.array()).all() &&
           (point.array() <= box_node.max.array()).all();
  }
};

/// A volume's node need not be visible: invisible boxes are how people mark places.
Aabb bounds_in_node(const Scene& scene, NodeId node) {
  const Affine node_from_world = scene.world_from_node(node).inverse();
  Aabb box;
  for (const NodeId below : scene.subtree(node)) {
    if (!scene[below].mesh) continue;
    box.add(scene[below].mesh->bounds().mapped(node_from_world * scene.world_from_node(below)));
  }
  return box;
}

std::vector<Volume> volumes_of(const Scene& scene, const std::string& pattern) {
  std::vector<Volume> volumes;
  for (const NodeId node : scene.match(pattern)) {
    Volume volume{bounds_in_node(scene, node), scene.world_from_node(node)};
    if (volume.box_node.is_empty()) continue;
    volume.cubic_metres =
        volume.box_node.size().prod() * std::abs(volume.world_from_node.linear().determinant());
    volumes.push_back(volume);
  }
  return volumes;
}

/// Large volumes get more; a point where two overlap is as likely as one elsewhere.
Vec3 draw_in_union(const std::vector<Volume>& volumes, Rng& rng) {
  double all = 0.0;
  for (const Volume& volume : volumes) all += volume.cubic_metres;
  for (;;) {
    double rest = rng.uniform(0.0, all);
    std::size_t chosen = 0;
    while (chosen + 1 < volumes.size() && rest >= volumes[chosen].cubic_metres) {
      rest -= volumes[chosen++].cubic_metres;
    }
    const Vec3 point = volumes[chosen].world_from_node * rng.uniform_in(volumes[chosen].box_node);
    const auto holders = std::count_if(volumes.begin(), volumes.end(),
                                       [&](const Volume& v) { return v.holds(point); });
    if (holders <= 1 || rng.index(std::size_t(holders)) == 0) return point;
  }
}

}  // namespace

void Scatter3d::Params::visit(ParamVisitor& v) {
  placement.visit(v);
  v.param(
      "volumes", volumes,
      {"Nodes whose boxes are filled, visible or not; null: `offset` says where.", kNodePattern});
  v.param("excluded", excluded, {"Nodes whose boxes are left free; null: none.", kNodePattern});
  v.param("offset", offset, {"Place, from the working area along the world's axes.", "m"}, 3);
}

Scatter3d::Scatter3d(Params params, Host& host) : params_(std::move(params)), host_(host) {}

void Scatter3d::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  if (scene.match(params_.placement.nodes).empty()) return;
  std::vector<Volume> volumes;
  if (params_.volumes) {
    volumes = volumes_of(scene, *params_.volumes);
    if (volumes.empty()) {
      throw Error(ErrorKind::Config,
                  "'volumes': nothing that fits '" + *params_.volumes + "' has a mesh");
    }
  }
  std::vector<Volume> excluded;
  if (params_.excluded) excluded = volumes_of(scene, *params_.excluded);
  const auto draw_point = [&](Rng& draws) -> Vec3 {
    if (!volumes.empty()) return draw_in_union(volumes, draws);
    return context.working_area_world +
           params_.offset.draw_vector(draws, std::uint64_t(context.occurrence));
  };
  const auto draw = [&](const Aabb& box, Rng& draws) -> Vec3 {
    Vec3 point = draw_point(draws);
    const auto is_excluded = [&] {
      return std::any_of(excluded.begin(), excluded.end(),
                         [&](const Volume& volume) { return volume.holds(point); });
    };
    for (int tries = 1; is_excluded() && tries < params_.placement.max_tries; ++tries) {
      point = draw_point(draws);
    }
    return point - box.centre();
  };
  place_freely(params_.placement, draw, rng, scene, host_);
}

}  // namespace diorama
