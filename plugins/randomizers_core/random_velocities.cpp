// SPDX-License-Identifier: Apache-2.0
#include "random_velocities.h"

#include "diorama/error.h"
#include "diorama/node_pattern.h"
#include "sampling.h"

namespace diorama {
namespace {

bool meet(const Aabb& a, const Aabb& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

std::optional<Aabb> box_of(const std::vector<double>& min, const std::vector<double>& max) {
  if (min.empty() && max.empty()) return std::nullopt;
  if (min.size() == 3 && max.size() == 3) {
    Aabb box;
    box.min = Vec3(min[0], min[1], min[2]);
    box.max = Vec3(max[0], max[1], max[2]);
    if ((box.min.array() <= box.max.array()).all()) return box;
  }
  throw Error(ErrorKind::Config,
              "box_min, box_max: expected [x, y, z] each, the second nowhere below the first");
}

}  // namespace

void RandomVelocities::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Rigid bodies to throw.", kNodePattern});
  v.param("velocity", velocity, {"Along the world's axes; null keeps it.", "m/s", -1e3, 1e3}, 3);
  v.param("angular_velocity_deg", angular_velocity_deg,
          {"About the world's axes; null keeps it.", "deg/s", -1e5, 1e5}, 3);
  v.param("box_min", box_min,
          {"Lower corner, from the working area, of a box: only nodes that meet it are thrown. "
           "Empty: all are.",
           "m"});
  v.param("box_max", box_max, {"Upper corner of that box.", "m"});
}

RandomVelocities::RandomVelocities(Params params, Host&)
    : params_(std::move(params)), box_(box_of(params_.box_min, params_.box_max)) {}

void RandomVelocities::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto is_thrown = [&](NodeId node) {
    if (!box_) return true;
    Aabb box = scene.world_bounds(node);
    if (box.is_empty()) box.add(scene.world_from_node(node).translation());
    box.min -= context.working_area_world;
    box.max -= context.working_area_world;
    return meet(box, *box_);
  };
  const auto change = [&](NodeId node, NodeDraws& draws) {
    if (!is_thrown(node)) return;
    Vec3 linear = scene[node].rigid_body->linear_velocity;
    Vec3 angular = scene[node].rigid_body->angular_velocity;
    if (params_.velocity) linear = draws.vector(*params_.velocity);
    if (params_.angular_velocity_deg) {
      angular = draws.vector(*params_.angular_velocity_deg) * radians(1.0);
    }
    scene.set_velocity(node, linear, angular);
  };
  const auto is_body = [](const Node& node) { return node.rigid_body.has_value(); };
  draw_for_each(scene, match_if(scene, params_.nodes, is_body), context, rng, change);
}

}  // namespace diorama
