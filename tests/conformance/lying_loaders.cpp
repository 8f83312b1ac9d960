// SPDX-License-Identifier: Apache-2.0
// Loaders that break one promise each.
#include <unistd.h>

#include <atomic>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "diorama/loader.h"
#include "diorama/plugin.h"

namespace diorama::test {

struct NoParams {
  void visit(ParamVisitor&) {}
};

/// Crates of 1 to 3 parts.
struct Crates : Loader {
  using Params = NoParams;
  Crates(Params, Host&) {}
  static constexpr std::string_view kScheme = "crate:";
  std::vector<std::string> claims() const override { return {std::string(kScheme)}; }
  std::vector<std::string> assets() const override { return {"crate:1", "crate:2", "crate:3"}; }
  void load(std::string_view asset, Scene& scene, NodeId root) override {
    const std::string_view rest = asset.substr(kScheme.size());
    if (rest.size() != 1 || rest[0] < '1' || rest[0] > '3') {
      throw Error(ErrorKind::Asset, std::string(asset) + ": expected crate:1 to crate:3");
    }
    fill(rest[0] - '0', scene, root);
  }
  virtual void fill(int parts, Scene& scene, NodeId root) {
    for (int i = 0; i < parts; ++i) add_part(scene, root, Vec3(0, 0, i), 0.5);
  }
  static NodeId add_part(Scene& scene, NodeId root, const Vec3& place, double size) {
    const NodeId id = scene.create(root, "part");
    scene.set_pose(id, Transform{place, Quat::Identity(), Vec3::Ones()});
    scene.edit(id).mesh = std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
    scene.edit(id).materials = {std::make_shared<const Material>()};
    return id;
  }
};

struct MovesTheNeighbour : Crates {
  using Crates::Crates;
  void fill(int parts, Scene& scene, NodeId root) override {
    Crates::fill(parts, scene, root);
    const NodeId first = scene[scene.root()].children.front();
    Affine pose = scene[first].parent_from_node;
    pose.translation().x() += 0.5;
    scene.set_pose(first, pose);
  }
};
struct RelabelsTheNeighbour : Crates {
  using Crates::Crates;
  void fill(int parts, Scene& scene, NodeId root) override {
    Crates::fill(parts, scene, root);
    scene.edit(scene[scene.root()].children.front()).labels = {{"class", "crate"}};
  }
};
/// Fails, but not without a trace.
struct SpoilsAndFails : Crates {
  using Crates::Crates;
  void load(std::string_view asset, Scene& scene, NodeId root) override {
    try {
      Crates::load(asset, scene, root);
    } catch (const Error&) {
      scene.create(scene.root(), "wreck");
      throw;
    }
  }
};
struct Grows : Crates {
  using Crates::Crates;
  int calls = 0;
  void fill(int, Scene& scene, NodeId root) override {
    add_part(scene, root, Vec3::Zero(), 0.1 * ++calls);
  }
};
struct ReadsItsName : Crates {
  using Crates::Crates;
  void fill(int, Scene& scene, NodeId root) override {
    add_part(scene, root, Vec3::Zero(), 0.1 * double(scene[root].name.size()));
  }
};
struct CountsThreads : Crates {
  CountsThreads(Params params, Host& host) : Crates(params, host), threads(host.thread_count()) {}
  int threads;
  void fill(int, Scene& scene, NodeId root) override {
    add_part(scene, root, Vec3::Zero(), 0.1 * threads);
  }
};
struct SecondCrateIsBroken : Crates {
  using Crates::Crates;
  void fill(int parts, Scene& scene, NodeId root) override {
    Crates::fill(parts, scene, root);
    if (parts != 2) return;
    scene.set_pose(root, Transform{Vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0),
                                   Quat::Identity(), Vec3::Ones()});
  }
};
struct LastCrateIsMissing : Crates {
  using Crates::Crates;
  std::vector<std::string> assets() const override { return {"crate:1", "crate:4"}; }
};
struct BlackHole : Crates {
  using Crates::Crates;
  void fill(int parts, Scene& scene, NodeId root) override {
    Crates::fill(parts, scene, root);
    auto material = std::make_shared<Material>();
    material->base_color = Vec3f::Constant(std::numeric_limits<float>::infinity());
    scene.edit(scene[root].children.front()).materials = {std::move(material)};
  }
};
struct InventsFiles : Crates {
  using Crates::Crates;
  std::vector<std::filesystem::path> files(std::string_view) const override {
    return {"/nowhere/crate.obj"};
  }
};
struct OtherAssetsEachTime : Crates {
  using Crates::Crates;
  mutable int calls = 0;
  std::vector<std::string> assets() const override {
    return {"crate:" + std::to_string(1 + calls++ % 3)};
  }
};
/// Two at work at once count each other's parts.
struct SharesACounter : Crates {
  using Crates::Crates;
  static inline std::atomic<int> at_work{0};
  void fill(int, Scene& scene, NodeId root) override {
    ++at_work;
    ::usleep(20000);
    add_part(scene, root, Vec3::Zero(), 0.1 * at_work);
    ::usleep(20000);
    --at_work;
  }
};
struct OfThisProcess : Crates {
  using Crates::Crates;
  void fill(int, Scene& scene, NodeId root) override {
    add_part(scene, root, Vec3::Zero(), 0.1 + 1e-6 * double(::getpid()));
  }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_loaders", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD_LOADER(Crates, "honest", "Makes crates.", "crate:");
  DIORAMA_ADD_LOADER(MovesTheNeighbour, "moves_the_neighbour", "Makes room.", "crate:");
  DIORAMA_ADD_LOADER(RelabelsTheNeighbour, "relabels_the_neighbour", "Names all.", "crate:");
  DIORAMA_ADD_LOADER(SpoilsAndFails, "spoils_and_fails", "Leaves wrecks.", "crate:");
  DIORAMA_ADD_LOADER(Grows, "grows", "Makes larger ones each time.", "crate:");
  DIORAMA_ADD_LOADER(ReadsItsName, "reads_its_name", "Looks at the node.", "crate:");
  DIORAMA_ADD_LOADER(CountsThreads, "counts_threads", "Looks at the machine.", "crate:");
  DIORAMA_ADD_LOADER(SecondCrateIsBroken, "second_is_broken", "Places badly.", "crate:");
  DIORAMA_ADD_LOADER(LastCrateIsMissing, "last_is_missing", "Names too many.", "crate:");
  DIORAMA_ADD_LOADER(BlackHole, "black_hole", "Colours badly.", "crate:");
  DIORAMA_ADD_LOADER(InventsFiles, "invents_files", "Lists what is not there.", "crate:");
  DIORAMA_ADD_LOADER(OtherAssetsEachTime, "other_assets", "Changes its mind.", "crate:");
  DIORAMA_ADD_LOADER(SharesACounter, "shares_a_counter", "Counts all loaders.", "crate:");
  DIORAMA_ADD_LOADER(OfThisProcess, "of_this_process", "Sizes by number.", "crate:");
}
