// SPDX-License-Identifier: Apache-2.0
//
// One input is one file of any kind: text, crate or package. Everything that it holds is read and,
// if it is a layer, composed, measured and put into a scene. Refusing is fine; crashing, hanging,
// running out of memory, and scenes with numbers that are none are findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>

#include "diorama/error.h"
#include "input_file.h"
#include "loader_usd/scene_translator.h"
#include "loader_usd/usd/asset_library.h"
#include "loader_usd/usd/crate_reader.h"
#include "loader_usd/usd/error.h"
#include "loader_usd/usd/extent.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/package.h"
#include "loader_usd/usd/stage.h"
#include "support/texture_host.h"

namespace {

namespace usd = diorama::usd;

constexpr std::size_t kMostPrims = 2000;

void visit(usd::Stage& stage, usd::Geometry& geometry, const usd::Prim& prim, std::size_t& budget) {
  for (const usd::Prim* child : stage.visible_children(prim)) {
    if (budget == 0) return;
    --budget;
    geometry.world_from_prim(*child);
    geometry.is_visible(*child);
    geometry.material(*child);
    geometry.primvars(*child);
    usd::local_extent(stage, *child);
    for (const std::string& name : stage.property_names(*child)) {
      stage.value(*child, name);
      stage.targets(*child, name);
    }
    visit(stage, geometry, *child, budget);
  }
}

// Aborts where a renderer would have to mistrust the scene.
void check(const diorama::Scene& scene) {
  for (const diorama::NodeId id : scene.subtree(scene.root())) {
    const diorama::Node& node = scene[id];
    bool is_sound = node.parent_from_node.matrix().allFinite();
    if (node.camera) is_sound &= node.camera->near_m > 0.0 && node.camera->fx > 0.0;
    if (node.light) is_sound &= node.light->color.allFinite();
    try {
      if (node.mesh) node.mesh->validate(node.name);
    } catch (const diorama::Error&) {
      is_sound = false;
    }
    if (!is_sound) std::abort();
  }
}

void translate(usd::Stage& stage) {
  diorama::test::TextureHost host;
  diorama::Scene scene;
  const diorama::NodeId root = scene.create(scene.root(), "asset");
  diorama::loader_usd::SceneTranslator(stage, host, scene).translate(root);
  check(scene);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data), size);
  try {
    if (!usd::is_package(bytes)) {
      const auto layer = usd::read_layer("input", usd::copy_bytes(bytes));
      layer->for_each_value([](const usd::Value&) {});
    }
  } catch (const usd::FormatError&) {
    return 0;
  }
  static const diorama::test::InputFile file(".usd");
  try {
    usd::Stage stage(file.write(data, size), usd::Sampling::OrFirstSample);
    usd::Geometry geometry(stage);
    std::size_t budget = kMostPrims;
    visit(stage, geometry, stage.root(), budget);
    if (budget > 0) translate(stage);
  } catch (const usd::FormatError&) {
    return 0;
  } catch (const diorama::Error&) {
    return 0;
  }
  return 0;
}
