// SPDX-License-Identifier: Apache-2.0
#include "diorama/loader.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/run_together.h"
#include "framework/host/scratch_folder.h"

namespace diorama::conformance {
namespace {

namespace fs = std::filesystem;

void check_claim(const std::string& claim) {
  const bool is_ending = claim.size() > 1 && claim.front() == '.';
  const bool is_scheme = claim.size() > 1 && claim.back() == ':';
  const bool is_beginning = claim.size() > 1 && claim.front() == '=';
  require(is_ending || is_scheme || is_beginning,
          "claims '" + claim +
              "', expected an ending such as '.obj', a scheme such as 'shelf:' or " +
              "what files without an ending begin with, '=#shelf'");
  if (is_beginning) return;
  require(std::none_of(claim.begin(), claim.end(), [](unsigned char c) { return std::isupper(c); }),
          "claims '" + claim + "', expected lower case");
}

constexpr std::size_t kMostAssets = 8;

/// A scene with a neighbour, and the empty node to load into.
struct Target {
  Scene scene;
  NodeId neighbour = scene.create(scene.root(), "neighbour");
  NodeId root;
  std::string others;

  explicit Target(const char* name = "asset") {
    scene.set_pose(neighbour, Transform{{1, 2, 3}, Quat::Identity(), Vec3::Ones()});
    scene.edit(neighbour).labels = {{"class", "neighbour"}};
    root = scene.create(scene.root(), name);
    others = state_of_others();
  }
  void require_others_untouched() const {
    const auto children = scene[scene.root()].children;
    require(children == std::vector<NodeId>{neighbour, root},
            "adds nodes beside the one that it was given");
    require(state_of_others() == others, "changes nodes that are not its own");
  }
  /// All that was loaded.
  std::string content() const {
    std::string all;
    for (const NodeId node : scene.subtree(root)) {
      all += node == root ? "" : scene[node].name;
      all += fingerprint(scene[node]);
    }
    return all;
  }

 private:
  std::string state_of_others() const {
    const auto& below = scene[neighbour].children;
    return std::to_string(below.size()) + fingerprint(scene[neighbour]) +
           fingerprint(scene[scene.root()]);
  }
};

/// The error is the loader's own; what it added below the node until then is the host's to erase.
void load_into_new_scene(Loader& loader, const std::string& asset) {
  Target target;
  try {
    loader.load(asset, target.scene, target.root);
  } catch (...) {
    target.require_others_untouched();
    throw;
  }
}

void require_sound(const Scene& scene, NodeId id) {
  const Node& node = scene[id];
  const std::string path = scene.path(id);
  if (node.mesh) node.mesh->validate(path);
  require(node.parent_from_node.matrix().allFinite(), path + " has a pose that is not finite");
  for (const auto& material : node.materials) {
    require(!material || (material->base_color.allFinite() && std::isfinite(material->roughness)),
            path + " has a material with a number that is not finite");
  }
  if (node.light) require(node.light->color.allFinite(), path + " has light that is not finite");
}

std::string loaded(Loader& loader, const std::string& asset, const char* name = "asset") {
  Target target(name);
  loader.load(asset, target.scene, target.root);
  target.require_others_untouched();
  for (const NodeId node : target.scene.subtree(target.root)) require_sound(target.scene, node);
  return target.content();
}

/// From first to last, no more than a few.
std::vector<std::string> some_of(const std::vector<std::string>& assets) {
  std::vector<std::string> some;
  const std::size_t count = std::min(assets.size(), kMostAssets);
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(assets[count == 1 ? 0 : i * (assets.size() - 1) / (count - 1)]);
  }
  return some;
}

void check_files(const Loader& loader, const std::string& asset) {
  const std::vector<fs::path> files = loader.files(asset);
  for (const fs::path& file : files) {
    require(fs::exists(file),
            asset + ": lists the file '" + file.string() + "', which is not there");
  }
  const bool is_file = fs::is_regular_file(asset);
  require(!is_file || (!files.empty() && files.front() == fs::path(asset)),
          asset + ": the first of its files is not the asset itself");
}

void check_same_everywhere(const Subject& subject, const std::string& asset) {
  const std::string first = loaded(*subject.make<Loader>(), asset);
  require(first == loaded(*subject.make<Loader>(), asset), asset + " differs the second time");
  const auto single = subject.make<Loader>(subject.single_threaded_host);
  require(first == loaded(*single, asset), asset + " differs with one thread");
  const auto loader = subject.make<Loader>();
  for (int i = 0; i < 2; ++i) {
    require(first == loaded(*loader, asset),
            asset + " differs when the same loader was at work before");
  }
  require(first == loaded(*loader, asset, "some_07"), asset + " differs by its node's name");
}

/// As visits in flight have it: each with a loader of its own.
void check_two_loaders_at_once(const Subject& subject, const std::string& asset) {
  const std::string alone = loaded(*subject.make<Loader>(), asset);
  const auto first = subject.make<Loader>();
  const auto second = subject.make<Loader>();
  std::string by_first;
  std::string by_second;
  run_together(2, [&](int thread) {
    Loader& loader = thread == 0 ? *first : *second;
    std::string& by_this = thread == 0 ? by_first : by_second;
    for (int i = 0; i < 5; ++i) by_this = loaded(loader, asset);
  });
  require(by_first == alone && by_second == alone,
          asset + " differs while another loader is at work");
}

/// Files that are not what their ending says. They lie outside of the folder that must stay empty.
void refuse_broken_files(Loader& loader, const std::string& ending) {
  const std::vector<std::string> contents{"", "<<< this is no model >>>\n", std::string(64, '\0'),
                                          std::string(5000, '\xff')};
  const ScratchFolder folder("broken");
  const fs::path file = folder.path() / ("broken" + ending);
  for (const std::string& content : contents) {
    std::ofstream(file, std::ios::binary) << content;
    std::string failure;
    try {
      require_error_naming(file.string(), [&] { load_into_new_scene(loader, file.string()); });
    } catch (const Error& error) {
      failure = error.what();
    }
    fs::remove(file);
    require(failure.empty(), failure);
  }
}

}  // namespace

std::string loader_output(const Subject& subject) {
  const std::vector<std::string> assets = subject.make<Loader>()->assets();
  std::string all;
  for (const std::string& asset : some_of(assets)) {
    all += asset + loaded(*subject.make<Loader>(), asset);
  }
  return all;
}

void check_loader(const CheckRun& run, const Subject& subject) {
  const std::unique_ptr<Loader> loader = subject.make<Loader>();
  const std::vector<std::string> claims = loader->claims();
  run.check("claims are endings, schemes and beginnings, and the listed ones", [&] {
    for (const std::string& claim : claims) check_claim(claim);
    require(!subject.entry.claims_are_listed || claims == subject.entry.claims,
            "claims() returns something else than the plugin file lists");
  });
  run.check("a missing asset is an error that names it", [&] {
    for (const std::string& claim : claims) {
      if (claim.front() == '=') continue;
      const std::string asset =
          claim.front() == '.' ? "/nowhere/missing" + claim : claim + "\x01 no such thing";
      require_error_naming(asset, [&] { load_into_new_scene(*loader, asset); });
    }
  });
  run.check("a file that is not what its ending says is an error that names it", [&] {
    for (const std::string& claim : claims) {
      if (claim.front() == '.') refuse_broken_files(*loader, claim);
    }
  });
  const std::vector<std::string> assets = loader->assets();
  run.check("its assets are the same each time", [&] {
    require(loader->assets() == assets && subject.make<Loader>()->assets() == assets,
            "assets() names others the second time");
  });
  if (assets.empty()) {
    run.skip("the same asset gives the same nodes, and nothing else is touched",
             "its parameters name no asset by default");
    return;
  }
  run.check("the same asset gives the same nodes, and nothing else is touched", [&] {
    for (const std::string& asset : some_of(assets)) check_same_everywhere(subject, asset);
  });
  run.check("the files of its assets are there", [&] {
    for (const std::string& asset : some_of(assets)) check_files(*loader, asset);
  });
  run.check("two loaders at work at once give the same",
            [&] { check_two_loaders_at_once(subject, assets.back()); });
}

}  // namespace diorama::conformance
