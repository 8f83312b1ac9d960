// SPDX-License-Identifier: Apache-2.0
#include "loader_samples/samples_loader.h"

#include <algorithm>
#include <array>

#include "loader_samples/model.h"
#include "loader_samples/sky.h"

namespace diorama::samples {
namespace {

constexpr std::string_view kSample = "sample:";
constexpr std::string_view kProp = "prop:";
constexpr std::string_view kSky = "sky:";
constexpr float kNitsPerUnit = 1000.0f;

std::vector<ModelKind> objects() {
  std::vector<ModelKind> all;
  for (const auto& list : {boxes(), containers(), tools()}) {
    all.insert(all.end(), list.begin(), list.end());
  }
  return all;
}

std::vector<std::string> names_of(std::span<const ModelKind> kinds) {
  std::vector<std::string> names;
  for (const ModelKind& kind : kinds) names.emplace_back(kind.name);
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> sky_names() {
  std::vector<std::string> names;
  for (const SkyLook& look : skies()) names.emplace_back(look.name);
  return names;
}

[[noreturn]] void reject(std::string_view asset, std::string_view name,
                         const std::vector<std::string>& names) {
  std::string text = std::string(asset) + ": no such sample";
  const std::string nearest = nearest_name(name, names);
  if (!nearest.empty()) {
    text += "; did you mean '" + nearest + "'?";
  } else {
    text += "; there are:";
    for (const std::string& n : names) text += " " + n;
  }
  throw Error(ErrorKind::Asset, text);
}

void put_model(const Model& model, const ModelKind& kind, Scene& scene, NodeId root) {
  // As in scanned sets, where a name that starts with a digit gets an underscore.
  const bool starts_with_digit = kind.name[0] >= '0' && kind.name[0] <= '9';
  const NodeId leaf =
      scene.create(root, starts_with_digit ? "_" + std::string(kind.name) : std::string(kind.name));
  Node& node = scene.edit(leaf);
  node.mesh = model.mesh;
  node.materials = model.materials;
  node.collider = Collider{};
  RigidBody body;
  body.mass_kg = kind.mass_kg;
  scene.edit(root).rigid_body = body;
}

}  // namespace

void SamplesLoader::Params::visit(ParamVisitor& v) {
  static constexpr std::array<const char*, 3> kSets{"objects", "props", "skies"};
  v.choice("set", set, kSets, {"Which assets it lists."});
}

SamplesLoader::SamplesLoader(Params params, Host& host) : params_(std::move(params)), host_(host) {}

std::vector<std::string> SamplesLoader::claims() const {
  return {std::string(kSample), std::string(kProp), std::string(kSky)};
}

std::vector<std::string> SamplesLoader::assets() const {
  const bool is_props = params_.set == "props", is_skies = params_.set == "skies";
  std::vector<std::string> names = is_skies   ? sky_names()
                                   : is_props ? names_of(props())
                                              : names_of(objects());
  const std::string_view scheme = is_skies ? kSky : is_props ? kProp : kSample;
  for (std::string& name : names) name.insert(0, scheme);
  return names;
}

void SamplesLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  if (asset.starts_with(kSky)) {
    const std::string_view name = asset.substr(kSky.size());
    for (const SkyLook& look : skies()) {
      if (look.name != name) continue;
      Light dome;
      dome.kind = LightKind::Dome;
      dome.color = Vec3f::Constant(kNitsPerUnit);
      dome.texture = make_sky(look, host_);
      scene.edit(root).light = dome;
      return;
    }
    reject(asset, name, sky_names());
  }
  const bool is_prop = asset.starts_with(kProp);
  const std::string_view name = asset.substr(is_prop ? kProp.size() : kSample.size());
  const std::span<const ModelKind> prop_kinds = props();
  const std::vector<ModelKind> kinds =
      is_prop ? std::vector<ModelKind>(prop_kinds.begin(), prop_kinds.end()) : objects();
  for (const ModelKind& kind : kinds) {
    if (kind.name != name) continue;
    put_model(kind.make(host_, Rng(stable_hash(kind.name))), kind, scene, root);
    return;
  }
  reject(asset, name, names_of(kinds));
}

}  // namespace diorama::samples
