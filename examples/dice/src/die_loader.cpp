// SPDX-License-Identifier: Apache-2.0
#include "die_loader.h"

#include <array>
#include <charconv>

#include "die.h"

namespace dice {

using diorama::Error;
using diorama::ErrorKind;
using diorama::Node;
using diorama::NodeId;
using diorama::Rng;
using diorama::Scene;

namespace {

constexpr std::string_view kAny = "die:";
constexpr std::string_view kPlain = "plain_die:";
constexpr double kDensity = 1200.0;  ///< kg/m^3, of acrylic.

}  // namespace

std::uint64_t asset_number(std::string_view asset) {
  const std::size_t colon = asset.find(':');
  const std::string_view digits = asset.substr(colon + 1);
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    throw Error(ErrorKind::Asset, std::string(asset) + ": '" + std::string(digits) +
                                      "' is no number; write " +
                                      std::string(asset.substr(0, colon + 1)) + "7, for example");
  }
  return number;
}

void DieLoader::Params::visit(diorama::ParamVisitor& v) {
  static constexpr std::array<const char*, 2> kLooks{"any", "plain"};
  v.param("models", models, {"How many different dice there are.", "", 1, 1e6});
  v.param("first", first, {"Number of the first of them.", "", 0, 1e9});
  v.choice("look", look, kLooks,
           {"any: marbled, speckled, clear, worn and plain plastic; plain: one colour, matt."});
}

std::vector<std::string> DieLoader::assets() const {
  std::vector<std::string> names;
  const std::string scheme(params_.look == "any" ? kAny : kPlain);
  for (int i = 0; i < params_.models; ++i) {
    names.push_back(scheme + std::to_string(params_.first + i));
  }
  return names;
}

void DieLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  const std::uint64_t number = asset_number(asset);
  const Rng rng = Rng(number).fork("die");
  const DieLook look = asset.starts_with(kPlain) ? plain_look(rng) : any_look(rng);

  const NodeId body = scene.create(root, "body");
  Node& node = scene.edit(body);
  node.mesh = die_mesh(look);
  node.materials = {die_material(look)};
  node.collider.emplace();
  node.collider->friction = 0.4;
  node.collider->restitution = 0.3;
  scene.edit(root).rigid_body.emplace();
  scene.edit(root).rigid_body->mass_kg = kDensity * look.edge_m * look.edge_m * look.edge_m;

  const std::array<diorama::Mat3, 6> turns = faces(look.is_mirrored);
  for (std::size_t i = 0; i < turns.size(); ++i) {
    diorama::Affine die_from_face = diorama::Affine::Identity();
    die_from_face.linear() = turns[i];
    die_from_face.translation() = 0.5 * look.edge_m * turns[i].col(2);
    scene.set_pose(scene.create(root, "face_" + std::to_string(i + 1)), die_from_face);
  }
}

}  // namespace dice
