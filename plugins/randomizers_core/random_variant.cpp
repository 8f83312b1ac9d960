// SPDX-License-Identifier: Apache-2.0
#include "random_variant.h"

#include <set>

#include "diorama/error.h"
#include "diorama/node_pattern.h"
#include "loader_support/asset_name.h"
#include "sampling.h"

namespace diorama {

void RandomVariant::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Objects to change, all made of the asset.", kNodePattern});
  v.param("asset", asset,
          {"The model file that they were made of; without it and variants nothing is done."});
  v.param("variants", variants, {"What is chosen from, by set: {lookVariant: [red, blue]}."});
}

RandomVariant::RandomVariant(Params params, Host& host) : params_(std::move(params)), host_(host) {
  if (params_.asset.empty() && params_.variants.kind == Value::Kind::Null) return;
  const auto expect = [&](bool holds, const std::string& found) {
    if (holds) return;
    throw Error(ErrorKind::Config,
                "variants: " + found + ", expected lists by set: {lookVariant: [red, blue]}");
  };
  if (params_.asset.empty()) {
    throw Error(ErrorKind::Config, "asset: is empty, expected the file that the nodes are made of");
  }
  (void)host_.resolve(params_.asset);
  expect(params_.variants.kind == Value::Kind::Map && !params_.variants.map.empty(),
         "found " + params_.variants.describe());
  for (const auto& [set, list] : params_.variants.map) {
    expect(list.kind == Value::Kind::List && !list.list.empty(),
           set + ": found " + list.describe());
    std::vector<std::string> names;
    for (const Value& item : list.list) {
      expect(item.kind == Value::Kind::Scalar, set + ": found " + item.describe());
      names.push_back(item.scalar);
    }
    sets_.emplace_back(set, std::move(names));
  }
}

std::string RandomVariant::draw_name(const NodeDraws& draws) const {
  std::string name = params_.asset;
  for (const auto& [set, names] : sets_) {
    Rng own = draws.rng.fork(set);
    name = loader_support::named_with(std::move(name), set, names[own.index(names.size())]);
  }
  return name;
}

const Scene& RandomVariant::variant(const std::string& name) {
  std::unique_ptr<Scene>& scene = loaded_[name];
  if (!scene) {
    auto made = std::make_unique<Scene>();
    host_.load_asset(name, *made, made->root());
    scene = std::move(made);
  }
  return *scene;
}

void RandomVariant::dress(Scene& scene, NodeId node, const std::string& name) {
  const Scene& look = variant(name);
  const std::string front = scene.path(node);
  std::set<NodeId> parts;
  for (const NodeId from : look.subtree(look.root())) {
    if (from == look.root()) continue;
    const NodeId to = scene.find(front + look.path(from));
    if (!to) {
      throw Error(
          ErrorKind::Asset,
          front + ": has no part '" + look.path(from).substr(1) + "' as " + name +
              " has; spawn a variant with all parts (objects: variants), and name the asset "
              "that it is made of");
    }
    parts.insert(to);
    const Node& wanted = look[from];
    const Node& now = scene[to];
    if (now.mesh == wanted.mesh && now.materials == wanted.materials &&
        now.is_visible == wanted.is_visible) {
      continue;
    }
    Node& edited = scene.edit(to);
    edited.mesh = wanted.mesh;
    edited.materials = wanted.materials;
    edited.is_visible = wanted.is_visible;
  }
  for (const NodeId below : scene.subtree(node)) {
    const bool is_extra = scene[below].mesh && below != node && !parts.contains(below);
    if (is_extra && scene[below].is_visible) scene.edit(below).is_visible = false;
  }
}

void RandomVariant::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  if (sets_.empty()) return;
  const auto change = [&](NodeId node, NodeDraws& draws) { dress(scene, node, draw_name(draws)); };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, change);
}

}  // namespace diorama
