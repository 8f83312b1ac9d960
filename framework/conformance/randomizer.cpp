// SPDX-License-Identifier: Apache-2.0
#include "diorama/randomizer.h"

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

void randomize_all_moments(Randomizer& randomizer, Scene& scene) {
  const Vec3 area(0.1, 0.0, 0.4);
  randomizer.randomize(scene, {"environment", -1, area}, Rng(1).fork("environment"));
  randomizer.randomize(scene, {"floating", 0, area}, Rng(1).fork("floating"));
  randomizer.randomize(scene, {"dropped", 1, area}, Rng(1).fork("dropped"));
}

Scene randomized(const Subject& subject, Host& host) {
  Scene scene = sample_scene();
  randomize_all_moments(*subject.make<Randomizer>(host), scene);
  return scene;
}

}  // namespace

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
  run.check("a capture does not depend on the captures before", [&] {
    const auto used = subject.make<Randomizer>();
    Scene earlier = sample_scene(), one = sample_scene(), other = sample_scene();
    randomize_all_moments(*used, earlier);
    const RandomizeContext context{"floating", 5, Vec3::Zero()};
    used->randomize(one, context, Rng(3));
    subject.make<Randomizer>()->randomize(other, context, Rng(3));
    require_same(one, other, "remembers earlier calls");
  });
}

}  // namespace diorama::conformance
