// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/object_coordinates.h"

#include <map>

namespace diorama {
namespace {

/// Maps world positions into the unit cube of the instance's box.
Affine unit_from_world(const Instance& instance) {
  const Vec3 size = instance.bounds_node.size();
  Vec3 factor = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    if (size[axis] > 0.0) factor[axis] = 1.0 / size[axis];
  }
  Affine unit_from_node = Affine::Identity();
  unit_from_node.linear() = factor.asDiagonal();
  unit_from_node.translation() = -(factor.asDiagonal() * instance.bounds_node.min);
  return unit_from_node * instance.world_from_node.inverse();
}

}  // namespace

NameSet ObjectCoordinates::needs() const {
  return {std::string(kInstanceId.name), std::string(kPosition.name), "instances"};
}
NameSet ObjectCoordinates::provides() const { return {std::string(kObjectCoordinates.name)}; }

void ObjectCoordinates::do_annotate(const Scene&, Frame& frame) const {
  std::map<std::uint32_t, Affine> maps;
  for (const Instance& instance : frame.instances) {
    maps.emplace(instance.id, unit_from_world(instance));
  }
  const auto& ids = frame.get(kInstanceId);
  const auto& positions = frame.get(kPosition);
  Image<Vec3f> coordinates(ids.width(), ids.height(), Vec3f::Zero());
  for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
    const auto map = maps.find(ids.pixels()[i]);
    if (map == maps.end()) continue;
    const Vec3 unit = map->second * positions.pixels()[i].cast<double>();
    coordinates.pixels()[i] = unit.cwiseMax(0.0).cwiseMin(1.0).cast<float>();
  }
  frame.set(kObjectCoordinates, std::move(coordinates));
}

}  // namespace diorama
