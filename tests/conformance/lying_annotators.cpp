// SPDX-License-Identifier: Apache-2.0
// Annotators and randomizers that break one promise each.
#include <ctime>

#include "diorama/annotator.h"
#include "diorama/plugin.h"
#include "diorama/randomizer.h"

namespace diorama::test {

struct NoParams {
  void visit(ParamVisitor&) {}
};

constexpr Channel<float> kMade{"made"};

Image<float> made_of(const Frame& frame, float value) {
  return Image<float>(frame.camera.width, frame.camera.height, value);
}

/// Makes a plain channel of the distances.
class Plain : public Annotator {
 public:
  using Params = NoParams;
  Plain(Params, Host&) {}
  NameSet needs() const override { return {"distance_to_camera"}; }
  NameSet provides() const override { return {"made"}; }

 protected:
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, frame.get(kDistanceToCamera));
  }
};

struct OverwritesColour : Plain {
  using Plain::Plain;
  void do_annotate(const Scene& scene, Frame& frame) const override {
    Plain::do_annotate(scene, frame);
    frame.set(kColor, Image<Rgba8>(frame.camera.width, frame.camera.height, {0, 0, 0, 255}));
  }
};
struct WrongSize : Plain {
  using Plain::Plain;
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, Image<float>(frame.camera.width + 1, frame.camera.height, 0.0f));
  }
};
/// Right for the first camera of anybody's tests.
struct OneSizeForAll : Plain {
  using Plain::Plain;
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, Image<float>(32, 24, 0.0f));
  }
};
struct ReadsUnasked : Plain {
  using Plain::Plain;
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, made_of(frame, frame.get(kNormals).at(0, 0).x()));
  }
};
/// Another result where some writer demanded normals.
struct LooksAround : Plain {
  using Plain::Plain;
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, made_of(frame, float(frame.instances.size())));
  }
};
struct ChangesInstances : Plain {
  using Plain::Plain;
  void do_annotate(const Scene& scene, Frame& frame) const override {
    Plain::do_annotate(scene, frame);
    if (!frame.instances.empty()) frame.instances.front().id += 1;
  }
};
struct ChangesExposure : Plain {
  using Plain::Plain;
  void do_annotate(const Scene& scene, Frame& frame) const override {
    Plain::do_annotate(scene, frame);
    frame.exposure *= 2.0;
  }
};
struct ReplacesTheFrame : Plain {
  using Plain::Plain;
  void do_annotate(const Scene&, Frame& frame) const override {
    Frame other;
    other.camera = frame.camera;
    other.set(kMade, made_of(frame, 1.0f));
    frame = std::move(other);
  }
};
struct Remembers : Plain {
  using Plain::Plain;
  mutable float last = 0.0f;
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kMade, made_of(frame, last));
    last = frame.get(kDistanceToCamera).at(3, 3);
  }
};
struct WrongType : Plain {
  using Plain::Plain;
  NameSet provides() const override { return {"motion"}; }
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(Channel<float>{"motion"}, made_of(frame, 0.0f));
  }
};
struct NeedsMore : Plain {
  using Plain::Plain;
  NameSet needs() const override { return {"distance_to_camera", "normals"}; }
};
struct NeedsItself : Plain {
  using Plain::Plain;
  NameSet needs() const override { return {"distance_to_camera", "made"}; }
};
struct HangsWhenEmpty : Plain {
  using Plain::Plain;
  void do_annotate(const Scene& scene, Frame& frame) const override {
    const auto pixels = frame.get(kDistanceToCamera).pixels();
    for (std::size_t i = 0; pixels[i] == float(kInfinity);) {
      const volatile std::size_t next = (i + 1) % pixels.size();
      i = next;
    }
    Plain::do_annotate(scene, frame);
  }
};

void lift(Scene& scene, NodeId node, double metres) {
  scene.set_pose(node, Affine(Eigen::Translation3d(0, 0, metres)) * scene[node].parent_from_node);
}

/// Lifts nodes by heights of its own making.
template <class Height>
struct Lifts : Randomizer {
  using Params = NoParams;
  Lifts(Params, Host&) {}
  void randomize(Scene& scene, const RandomizeContext&, const Rng& rng) override {
    Height height;
    Rng stream = rng;
    for (const NodeId node : scene.match("/Assets/*")) {
      lift(scene, node, height(scene, node, stream));
    }
  }
};
struct OfForkedStreams {
  double operator()(const Scene& scene, NodeId node, Rng& stream) {
    Rng own = stream.fork(scene.path(node));
    return own.uniform(0.0, 1.0);
  }
};
struct OfOneStream {
  double operator()(const Scene&, NodeId, Rng& stream) { return stream.uniform(0.0, 1.0); }
};
struct OfNodeNumbers {
  double operator()(const Scene&, NodeId node, Rng& stream) {
    Rng own = stream.fork(node.index);
    return own.uniform(0.0, 1.0);
  }
};
struct OfTheClock {
  double operator()(const Scene&, NodeId, Rng&) { return 0.001 * double(std::time(nullptr) % 999); }
};
struct OfAddresses {
  double operator()(const Scene& scene, NodeId node, Rng&) {
    return 1e-6 * double(reinterpret_cast<std::uintptr_t>(&scene[node]) % 99991);
  }
};

/// Cameras in the order in which they come share a stream.
struct TurnsCameras : Randomizer {
  using Params = NoParams;
  TurnsCameras(Params, Host&) {}
  void randomize(Scene& scene, const RandomizeContext&, const Rng& rng) override {
    Rng stream = rng;
    for (const NodeId node : scene.match("/Cameras/*")) lift(scene, node, stream.uniform(0.0, 1.0));
  }
};
struct PaintsInOrder : Randomizer {
  using Params = NoParams;
  PaintsInOrder(Params, Host&) {}
  void randomize(Scene& scene, const RandomizeContext&, const Rng& rng) override {
    Rng stream = rng;
    for (const NodeId node : scene.subtree(scene.root())) {
      if (!scene[node].mesh) continue;
      auto paint = std::make_shared<Material>();
      paint->roughness = float(stream.uniform(0.0, 1.0));
      scene.edit(node).materials = {std::move(paint)};
    }
  }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_annotators", "1.0.0", "MIT") {
  using namespace diorama::test;
#define ADD_MADE(T, TYPE) \
  DIORAMA_ADD_ANNOTATOR(T, TYPE, "Makes a channel.", "distance_to_camera", "made")
  ADD_MADE(Plain, "plain");
  ADD_MADE(OverwritesColour, "overwrites_colour");
  ADD_MADE(WrongSize, "wrong_size");
  ADD_MADE(OneSizeForAll, "one_size_for_all");
  ADD_MADE(ReadsUnasked, "reads_unasked");
  ADD_MADE(LooksAround, "looks_around");
  ADD_MADE(ChangesInstances, "changes_instances");
  ADD_MADE(ChangesExposure, "changes_exposure");
  ADD_MADE(ReplacesTheFrame, "replaces_the_frame");
  ADD_MADE(Remembers, "remembers");
  ADD_MADE(NeedsMore, "needs_more");
  ADD_MADE(HangsWhenEmpty, "hangs_when_empty");
  DIORAMA_ADD_ANNOTATOR(WrongType, "wrong_type", "Makes motion.", "distance_to_camera", "motion");
  DIORAMA_ADD_ANNOTATOR(NeedsItself, "needs_itself", "Makes a channel.", "distance_to_camera made",
                        "made");
#undef ADD_MADE
  DIORAMA_ADD(Lifts<OfForkedStreams>, "lifts", "Breaks nothing.");
  DIORAMA_ADD(Lifts<OfOneStream>, "one_stream", "Draws for all from one stream.");
  DIORAMA_ADD(Lifts<OfNodeNumbers>, "node_numbers", "Forks by numbers of nodes.");
  DIORAMA_ADD(Lifts<OfTheClock>, "clock", "Goes by the time.");
  DIORAMA_ADD(Lifts<OfAddresses>, "addresses", "Goes by addresses.");
  DIORAMA_ADD(TurnsCameras, "turns_cameras", "Draws for all cameras from one stream.");
  DIORAMA_ADD(PaintsInOrder, "paints_in_order", "Draws for all meshes from one stream.");
}
