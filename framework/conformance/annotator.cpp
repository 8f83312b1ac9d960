// SPDX-License-Identifier: Apache-2.0
#include "diorama/annotator.h"

#include <utility>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"
#include "framework/datasets/frame_copy.h"

namespace diorama::conformance {
namespace {

/// The frame without the channels and annotations that are not among `names`.
Frame reduced(const Frame& frame, const NameSet& names) {
  Frame less = copy_of(frame, names);
  // Whoever makes the picture says how it was exposed.
  if (!names.contains(kColor.name)) less.exposure = Frame().exposure;
  if (!names.contains("instances")) less.instances.clear();
  for (Instance& instance : less.instances) {
    if (!names.contains("visibility")) instance.visibility.reset();
    if (instance.visibility && !names.contains("amodal_mask")) {
      instance.visibility->amodal_mask = {};
    }
  }
  if (!names.contains("occlusion_order")) less.occlusions.clear();
  return less;
}

NameSet names_in(const Frame& frame) {
  NameSet names = frame.channels();
  names.insert(painted_annotations().begin(), painted_annotations().end());
  return names;
}

NameSet without(NameSet names, const NameSet& others) {
  for (const std::string& name : others) names.erase(name);
  return names;
}

/// What it made of one camera's frame; all else must be as it was.
std::string annotated(const Annotator& annotator, const Scene& scene, Frame frame) {
  const NameSet provided = annotator.provides();
  const NameSet others = without(names_in(frame), provided);
  const std::string before = fingerprint(reduced(frame, others));
  annotator.annotate(scene, frame);
  require(before == fingerprint(reduced(frame, others)),
          "changes the frame beyond what it says it provides");
  return fingerprint(reduced(frame, provided));
}

/// Both cameras of the sample scene, which differ in size.
std::string annotated_scene(const Subject& subject, const Scene& scene, Host& host,
                            bool has_needs_only = false) {
  const auto annotator = subject.make<Annotator>(host);
  std::string all;
  for (const NodeId camera : cameras_of(scene)) {
    Frame frame = painted_frame(scene, camera, host);
    if (has_needs_only) frame = reduced(frame, annotator->needs());
    all += annotated(*annotator, scene, std::move(frame));
  }
  return all;
}

/// The first thing it needs that painted frames lack; such an annotator works after another one.
std::string foreign_need(const Annotator& annotator, Host& host) {
  const Scene scene = sample_scene();
  const NameSet names = names_in(painted_frame(scene, cameras_of(scene).front(), host));
  for (const std::string& name : annotator.needs()) {
    if (!names.contains(name)) return name;
  }
  return {};
}

void require_listed(const char* what, const NameSet& found,
                    const std::vector<std::string>& listed) {
  require(found == NameSet(listed.begin(), listed.end()),
          std::string(what) + " returns other names than the plugin lists");
}

}  // namespace

std::string annotator_output(const Subject& subject) {
  if (!foreign_need(*subject.make<Annotator>(), subject.host).empty()) return {};
  return annotated_scene(subject, sample_scene(), subject.host);
}

void check_annotator(const CheckRun& run, const Subject& subject) {
  const auto annotator = subject.make<Annotator>();
  run.check("it needs and provides what its plugin lists", [&] {
    require(!annotator->provides().empty(), "provides nothing");
    require_listed("needs()", annotator->needs(), subject.entry.needs);
    require_listed("provides()", annotator->provides(), subject.entry.provides);
    for (const std::string& name : annotator->provides()) {
      require(!annotator->needs().contains(name), "needs '" + name + "', which it provides itself");
    }
  });
  const std::string foreign = foreign_need(*annotator, subject.host);
  if (!foreign.empty()) {
    run.skip("frames are annotated", "needs '" + foreign + "', which another plugin makes");
    return;
  }
  run.check("a frame that shows nothing is survived", [&] {
    Scene scene;
    const NodeId camera = scene.create(scene.root(), "camera");
    scene.edit(camera).camera = Camera::from_lens(3, 2, 24.0, 20.955);
    annotated(*subject.make<Annotator>(), scene, painted_frame(scene, camera, subject.host));
  });
  run.check("it sets what it provides and reads what it needs", [&] {
    const Scene scene = sample_scene();
    require(annotated_scene(subject, scene, subject.host) ==
                annotated_scene(subject, scene, subject.host, true),
            "gives something else when annotations that it does not ask for are not there");
  });
  run.check("a frame is annotated, the same each time, and the scene left as it was", [&] {
    const Scene scene = sample_scene();
    const std::string first = annotated_scene(subject, scene, subject.host);
    require_same(sample_scene(), scene, "changes the scene");
    require(first == annotated_scene(subject, scene, subject.host), "differs the second time");
    require(first == annotated_scene(subject, scene, subject.single_threaded_host),
            "differs with one thread");
  });
  run.check("a frame does not depend on the frames before", [&] {
    const auto used = subject.make<Annotator>();
    const auto last = [&](const Annotator& with) {
      const Scene scene = sample_scene(1);
      return annotated(with, scene, painted_frame(scene, cameras_of(scene).back(), subject.host));
    };
    const Scene earlier = sample_scene();
    for (const NodeId camera : cameras_of(earlier)) {
      annotated(*used, earlier, painted_frame(earlier, camera, subject.host));
    }
    require(last(*used) == last(*subject.make<Annotator>()), "remembers earlier frames");
  });
}

}  // namespace diorama::conformance
