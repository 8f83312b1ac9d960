// SPDX-License-Identifier: Apache-2.0
#include "diorama/randomizer.h"

#include <map>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

void randomize_all_moments(Randomizer& randomizer, Scene& scene) {
  const Vec3 area(0.1, 0.0, 0.4);
  randomizer.randomize(scene, {"environment", -1, area, 0, {}}, Rng(1).fork("environment"));
  randomizer.randomize(scene, {"floating", 0, area, 0, {}}, Rng(1).fork("floating"));
  randomizer.randomize(scene, {"dropped", 1, area, 0, {}}, Rng(1).fork("dropped"));
}

Scene randomized(const Subject& subject, Host& host) {
  Scene scene = sample_scene();
  randomize_all_moments(*subject.make<Randomizer>(host), scene);
  return scene;
}

/// A node more in the sample scene, before those of its kind and taking no room, so that only a
/// stream that nodes share passes its draws on to others.
struct Addition {
  Extra extra;
  const char* what;
  const char* folder;  ///< Only nodes in here are compared; randomizers may look at all others.
  bool compares_poses;
};

constexpr Addition kAdditions[]{
    {Extra::Place, "a node without a mesh", "/Assets/", true},
    // It may be set down where others would have been.
    {Extra::Crumb, "a very small box", "/Assets/", false},
    {Extra::Camera, "a camera", "/Cameras/", true},
    {Extra::Lamp, "a lamp", "/Lights/", true},
};

/// What each node in a folder became, by path.
std::map<std::string, std::string> outcomes(const Subject& subject, const Addition& addition,
                                            Extra extra) {
  Scene scene = sample_scene(0, extra);
  randomize_all_moments(*subject.make<Randomizer>(), scene);
  std::map<std::string, std::string> nodes;
  for (const NodeId id : scene.subtree(scene.root())) {
    Node node = scene[id];
    if (!addition.compares_poses) node.parent_from_node = Affine::Identity();
    const std::string path = scene.path(id);
    if (path.starts_with(addition.folder)) nodes[path] = fingerprint(node);
  }
  return nodes;
}

void check_streams(const Subject& subject) {
  for (const Addition& addition : kAdditions) {
    std::map<std::string, std::string> with_it;
    try {
      with_it = outcomes(subject, addition, addition.extra);
    } catch (const Error&) {
      continue;  // it takes no such nodes
    }
    for (const auto& [path, alone] : outcomes(subject, addition, Extra::None)) {
      require(with_it[path] == alone, "draws something else for " + path + " when there is " +
                                          addition.what +
                                          " before it; fork the stream by the node's path");
    }
  }
}

}  // namespace

std::string randomizer_output(const Subject& subject) {
  return fingerprint(randomized(subject, subject.host));
}

void check_randomizer(const CheckRun& run, const Subject& subject) {
  run.check("an empty scene is survived", [&] {
    Scene scene;
    randomize_all_moments(*subject.make<Randomizer>(), scene);
  });
  run.check("the same stream gives the same scene, for any number of threads", [&] {
    const Scene scene = randomized(subject, subject.host);
    require_same(scene, randomized(subject, subject.host), "differs the second time");
    require_same(scene, randomized(subject, subject.single_threaded_host),
                 "differs with one thread");
  });
  run.check("one node more leaves the draws of the others as they were",
            [&] { check_streams(subject); });
  run.check("a capture does not depend on the captures before", [&] {
    const auto used = subject.make<Randomizer>();
    Scene earlier = sample_scene(), one = sample_scene(), other = sample_scene();
    randomize_all_moments(*used, earlier);
    const RandomizeContext context{"floating", 5, Vec3::Zero(), 0, {}};
    used->randomize(one, context, Rng(3));
    subject.make<Randomizer>()->randomize(other, context, Rng(3));
    require_same(one, other, "remembers earlier calls");
  });
}

}  // namespace diorama::conformance
