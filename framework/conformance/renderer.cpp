// SPDX-License-Identifier: Apache-2.0
#include "diorama/renderer.h"

#include <algorithm>
#include <cmath>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

Frame rendered(Renderer& renderer, NodeId camera) {
  return renderer.render({camera, renderer.provides(), 1});
}

/// Every camera of the sample scene, with all channels.
std::string rendered_scene(const Subject& subject, Host& host) {
  const auto renderer = subject.make<Renderer>(host);
  const Scene scene = sample_scene();
  renderer->prepare(scene);
  std::string frames;
  for (const NodeId camera : cameras_of(scene)) {
    frames += fingerprint(rendered(*renderer, camera));
    for (const CoverageMask& mask : renderer->cover(camera, labelled_instances(scene), true)) {
      frames.append(mask.bits.begin(), mask.bits.end());
      frames.append(reinterpret_cast<const char*>(mask.distances.data()),
                    mask.distances.size() * sizeof(float));
    }
  }
  require_same(sample_scene(), scene, "changes the scene");
  return frames;
}

/// Where no leaf was hit, the other channels say so in the way of conventions.md.
void check_misses(const Frame& frame) {
  const Image<std::uint32_t>& leaves = frame.get(kLeafId);
  const auto check = [&]<class Pixel>(const Channel<Pixel>& channel, const auto& is_miss) {
    if (!frame.has(channel.name)) return;
    const auto pixels = frame.get(channel).pixels();
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      require(leaves.pixels()[i] != 0 || is_miss(pixels[i]),
              "channel '" + std::string(channel.name) + "' has a value where nothing was hit");
    }
  };
  const auto is_infinite = [](float value) { return std::isinf(value) && value > 0; };
  const auto is_zero = [](const auto& value) { return value.isZero(0); };
  check(kDistanceToCamera, is_infinite);
  check(kDistanceToImagePlane, is_infinite);
  check(kNormals, is_zero);
  check(kPosition, is_zero);
  check(kUv, is_zero);
  check(kAlbedo, is_zero);
  check(kMotion, is_zero);
}

/// The pixels of an instance are among those that it covers alone, at the distance of the picture.
void check_coverage(Renderer& renderer, const Scene& scene, const Frame& frame, NodeId camera) {
  const std::vector<LabelledInstance> instances = labelled_instances(scene);
  const std::vector<CoverageMask> masks = renderer.cover(camera, instances, true);
  const Image<std::uint32_t>& leaves = frame.get(kLeafId);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const std::string path = scene.path(instances[i].node);
    for (int y = 0; y < leaves.height(); ++y) {
      for (int x = 0; x < leaves.width(); ++x) {
        const auto& own = instances[i].leaves;
        const bool is_own = std::ranges::find(own, NodeId{leaves.at(x, y)}) != own.end();
        if (!is_own) continue;
        require(masks[i].covers(x, y), path + " is seen where cover() says it is not");
        if (!frame.has(kDistanceToCamera.name)) continue;
        const float seen = frame.get(kDistanceToCamera).at(x, y);
        const float covered = masks[i].distances[masks[i].index(x, y)];
        require(std::abs(seen - covered) <= 1e-4f * seen,
                path + " is seen at another distance than cover() says");
      }
    }
  }
}

void check_ids(const Subject& subject) {
  const auto renderer = subject.make<Renderer>();
  const Scene scene = sample_scene();
  renderer->prepare(scene);
  const NodeId camera = cameras_of(scene).front();
  const Frame frame = rendered(*renderer, camera);
  require(frame.has(kLeafId.name), "does not provide 'leaf_id', which all labels follow from");
  const NodeId hidden = scene.require("/Assets/hidden"), box = scene.require("/Assets/box");
  const auto ids = frame.get(kLeafId).pixels();
  require(std::ranges::find(ids, box.index) != ids.end(), "does not show a box before the camera");
  require(std::ranges::find(ids, hidden.index) == ids.end(), "shows a hidden node");
  check_misses(frame);
  check_coverage(*renderer, scene, frame, camera);
}

}  // namespace

void check_renderer(const CheckRun& run, const Subject& subject) {
  run.check("an empty scene gives every channel and is left as it was", [&] {
    const auto renderer = subject.make<Renderer>();
    Scene scene;
    const NodeId camera = scene.create(scene.root(), "camera");
    scene.edit(camera).camera = Camera::from_lens(19, 11, 24.0, 20.955);
    const std::string before = fingerprint(scene);
    require(!renderer->provides().empty(), "provides nothing");
    renderer->prepare(scene);
    const Frame frame = rendered(*renderer, camera);
    for (const std::string& channel : renderer->provides()) {
      require(frame.has(channel), "does not fill '" + channel + "', which it provides");
    }
    if (frame.has(kLeafId.name)) check_misses(frame);
    require(before == fingerprint(scene), "changes the scene");
  });
  run.check("ids, misses and coverage are as conventions.md has them", [&] { check_ids(subject); });
  run.check("the same seed gives the same bytes for any number of threads, the scene stays", [&] {
    const std::string frames = rendered_scene(subject, subject.host);
    require(frames == rendered_scene(subject, subject.host), "differs the second time");
    require(frames == rendered_scene(subject, subject.single_threaded_host),
            "differs with one thread");
  });
  run.check("a second scene after the first one was destroyed is survived", [&] {
    const auto renderer = subject.make<Renderer>();
    for (int round = 0; round < 2; ++round) {
      const Scene scene = sample_scene(round);
      renderer->prepare(scene);
      rendered(*renderer, cameras_of(scene).front());
    }
  });
}

}  // namespace diorama::conformance
