// SPDX-License-Identifier: Apache-2.0
#include "diorama/loader.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <fstream>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"

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

/// A scene with a neighbour, and the empty node to load into.
struct Target {
  Scene scene;
  NodeId neighbour = scene.create(scene.root(), "neighbour");
  NodeId root = scene.create(scene.root(), "asset");
};

void load_into_new_scene(Loader& loader, const std::string& asset) {
  Target target;
  loader.load(asset, target.scene, target.root);
}

std::string loaded(const Subject& subject, const std::string& asset) {
  Target target;
  subject.make<Loader>()->load(asset, target.scene, target.root);
  const auto children = target.scene[target.scene.root()].children;
  require(children == std::vector<NodeId>{target.neighbour, target.root},
          "adds nodes beside the one that it was given");
  require(target.scene.subtree(target.neighbour).size() == 1, "changes nodes that are not its own");
  for (const NodeId node : target.scene.subtree(target.root)) {
    if (const auto& mesh = target.scene[node].mesh) mesh->validate(target.scene.path(node));
  }
  return fingerprint(target.scene);
}

/// Files that are not what their ending says. They lie outside of the folder that must stay empty.
void refuse_broken_files(Loader& loader, const std::string& ending) {
  const std::vector<std::string> contents{"", "<<< this is no model >>>\n", std::string(64, '\0'),
                                          std::string(5000, '\xff')};
  const fs::path file =
      fs::temp_directory_path() / ("diorama_broken_" + std::to_string(getpid()) + ending);
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
  return assets.empty() ? "" : loaded(subject, assets.front());
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
  if (assets.empty()) {
    run.skip("the same asset gives the same nodes, and nothing else is touched",
             "its parameters name no asset by default");
    return;
  }
  run.check("the same asset gives the same nodes, and nothing else is touched", [&] {
    const std::string first = loaded(subject, assets.front());
    require(first == loaded(subject, assets.front()), assets.front() + " differs the second time");
  });
}

}  // namespace diorama::conformance
