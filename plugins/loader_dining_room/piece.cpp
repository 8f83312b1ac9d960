// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/piece.h"

#include <utility>

namespace diorama::dining_room {
namespace {
constexpr std::size_t kLongestName = 63;

std::string number(Rng rng) { return std::to_string(1000000 + rng.index(9000000)); }
}  // namespace

Piece finish(modelling::MeshBuilder& builder, std::vector<modelling::MaterialPtr> materials) {
  Piece piece;
  piece.centre = builder.centre_on_vertex_mean();
  piece.mesh = builder.build();
  piece.materials = std::move(materials);
  return piece;
}

std::string factory_name(std::string_view factory, Rng factory_rng, Rng object_rng,
                         std::string_view ending) {
  std::string name = std::string(factory) + "_" + number(factory_rng.fork("factory")) +
                     "__spawn_asset_" + number(object_rng.fork("object")) + "_" +
                     std::string(ending);
  if (name.size() > kLongestName) name.resize(kLongestName);
  return name;
}

std::string factory_name(std::string_view factory, Rng rng, std::string_view ending) {
  return factory_name(factory, rng, rng, ending);
}

NodeId place(Scene& scene, NodeId parent, std::string_view name, const Piece& piece,
             const Affine& room_from_piece) {
  const NodeId group = scene.create(parent, name);
  scene.set_pose(group, Affine(room_from_piece * modelling::at(piece.centre)));
  const NodeId leaf = scene.create(group, scene[group].name);
  Node& node = scene.edit(leaf);
  node.mesh = piece.mesh;
  node.materials = piece.materials;
  return group;
}

}  // namespace diorama::dining_room
