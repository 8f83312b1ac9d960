// SPDX-License-Identifier: Apache-2.0
#include "diorama/annotator.h"

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

std::string annotated(const Subject& subject, const Scene& scene, Host& host) {
  const auto annotator = subject.make<Annotator>(host);
  Frame frame = painted_frame(scene, cameras_of(scene).front(), host);
  annotator->annotate(scene, frame);
  for (const std::string& name : annotator->provides()) {
    require(frame.has(name) || painted_annotations().contains(name),
            "provides '" + name + "', but the channel is not there afterwards");
  }
  return fingerprint(frame);
}

/// The first thing it needs that painted frames lack; such an annotator works after another one.
std::string foreign_need(const Annotator& annotator, Host& host) {
  const Scene scene = sample_scene();
  const Frame frame = painted_frame(scene, cameras_of(scene).front(), host);
  for (const std::string& name : annotator.needs()) {
    if (!frame.has(name) && !painted_annotations().contains(name)) return name;
  }
  return {};
}

}  // namespace

void check_annotator(const CheckRun& run, const Subject& subject) {
  const auto annotator = subject.make<Annotator>();
  run.check("it says what it needs and provides", [&] {
    annotator->needs();
    require(!annotator->provides().empty(), "provides nothing");
  });
  const std::string foreign = foreign_need(*annotator, subject.host);
  if (!foreign.empty()) {
    run.skip("frames are annotated", "needs '" + foreign + "', which another plugin makes");
    return;
  }
  run.check("a frame that shows nothing is survived", [&] {
    Scene scene;
    scene.edit(scene.create(scene.root(), "camera")).camera = Camera::from_lens(3, 2, 24.0, 20.955);
    annotated(subject, scene, subject.host);
  });
  run.check("a frame is annotated, the same each time, and the scene left as it was", [&] {
    const Scene scene = sample_scene();
    const std::string first = annotated(subject, scene, subject.host);
    require_same(sample_scene(), scene, "changes the scene");
    require(first == annotated(subject, scene, subject.host), "differs the second time");
    require(first == annotated(subject, scene, subject.single_threaded_host),
            "differs with one thread");
  });
}

}  // namespace diorama::conformance
