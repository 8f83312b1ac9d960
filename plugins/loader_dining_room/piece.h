// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/rng.h"
#include "diorama/scene.h"
#include "modelling/mesh_builder.h"
#include "modelling/surfaces.h"

namespace diorama::dining_room {

/// A finished object, to be placed once or often. Its mesh is centred on the mean of its vertices.
struct Piece {
  std::shared_ptr<const Mesh> mesh;
  std::vector<modelling::MaterialPtr> materials;  ///< One per slot.
  Vec3 centre = Vec3::Zero();                     ///< That mean, in the space it was built in.
};
Piece finish(modelling::MeshBuilder& builder, std::vector<modelling::MaterialPtr> materials);

/// "<Factory>_<seed>__spawn_asset_<seed>_<ending>", cut to the 63 characters of a Blender name. The
/// seeds have seven digits and come from `rng`.
std::string factory_name(std::string_view factory, Rng rng, std::string_view ending = "");
/// The same with another object number: equal things made by one factory.
std::string factory_name(std::string_view factory, Rng factory_rng, Rng object_rng,
                         std::string_view ending = "");

/// A group node called `name` at the piece's centre and below it a mesh node of the same name.
NodeId place(Scene& scene, NodeId parent, std::string_view name, const Piece& piece,
             const Affine& room_from_piece);

}  // namespace diorama::dining_room
