// SPDX-License-Identifier: Apache-2.0
#include "throw_dice.h"

#include <algorithm>

namespace dice {

using diorama::Affine;
using diorama::NodeId;
using diorama::Rng;
using diorama::Scene;
using diorama::Vec3;

void ThrowDice::Params::visit(diorama::ParamVisitor& v) {
  v.param("nodes", nodes, {"What is thrown.", diorama::kNodePattern});
  v.param("area", area,
          {"Node whose x and y axes reach from the middle to the rims of the area; its z is the "
           "floor.",
           diorama::kNodePattern});
  v.param("spread", spread, {"Share of the area over which one throw is spread.", "", 0.01, 1});
  v.param("height_m", height_m, {"Height above the floor.", "m", 0, 10});
  v.param("speed", speed, {"Largest speed along each axis of the floor.", "m/s", 0, 100});
  v.param("spin", spin, {"Largest spin about each axis.", "rad/s", 0, 1000});
}

void ThrowDice::randomize(Scene& scene, const diorama::RandomizeContext& context, const Rng& rng) {
  Affine world_from_area = Affine::Identity();
  world_from_area.translation() = context.working_area_world;
  world_from_area.linear() *= 0.1;
  const std::vector<NodeId> areas = scene.match(params_.area);
  if (areas.empty()) {
    host_.log(diorama::LogLevel::Warning, "throw_dice: no node matches '" + params_.area +
                                              "'; the area is 20 cm wide about the working area");
  } else {
    world_from_area = scene.world_from_node(areas.front());
  }
  Rng common = rng.fork("throw");
  const double spread = params_.spread.draw(common);
  const double room = 1.0 - spread;
  const double middle_x = room * common.uniform(-1.0, 1.0);
  const double middle_y = room * common.uniform(-1.0, 1.0);

  struct Ball {
    Vec3 centre;
    double radius;
  };
  std::vector<Ball> placed;
  for (const NodeId node : scene.match(params_.nodes)) {
    Rng own = rng.fork(scene.path(node));
    const double radius = 0.5 * scene.world_bounds(node).size().norm();
    Vec3 place = Vec3::Zero();
    for (int attempt = 0; attempt < 200; ++attempt) {
      const double x = middle_x + spread * own.uniform(-1.0, 1.0);
      const double y = middle_y + spread * own.uniform(-1.0, 1.0);
      place = world_from_area * Vec3(x, y, 0.0);
      // A crowd that does not fit side by side grows upwards.
      place.z() += radius + params_.height_m.draw(own) + 0.001 * attempt;
      const bool is_free = std::none_of(placed.begin(), placed.end(), [&](const Ball& other) {
        return (other.centre - place).norm() < other.radius + radius;
      });
      if (is_free) break;
    }
    placed.push_back({place, radius});
    scene.set_pose(node, Affine(Eigen::Translation3d(place) * own.uniform_rotation()));
    if (auto& body = scene.edit(node).rigid_body) {
      for (int axis = 0; axis < 3; ++axis) {
        if (axis < 2) body->linear_velocity[axis] = params_.speed * own.uniform(-1.0, 1.0);
        body->angular_velocity[axis] = params_.spin * own.uniform(-1.0, 1.0);
      }
    }
  }
}

}  // namespace dice
