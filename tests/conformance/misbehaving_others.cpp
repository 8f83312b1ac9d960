// SPDX-License-Identifier: Apache-2.0
// Components of the other kinds that break one promise each.
#include "diorama/annotator.h"
#include "diorama/loader.h"
#include "diorama/physics_backend.h"
#include "diorama/plugin.h"
#include "diorama/randomizer.h"
#include "diorama/renderer.h"

namespace diorama::test {

struct NoParams {
  void visit(ParamVisitor&) {}
};

/// Parameters with faults of their own.
struct UndocumentedParams {
  double width = 1;
  void visit(ParamVisitor& v) { v.param("width", width, {"no sentence"}); }
};

struct Forgetful : Randomizer {
  using Params = UndocumentedParams;
  Forgetful(Params, Host&) {}
  int calls = 0;
  void randomize(Scene& scene, const RandomizeContext&, const Rng&) override {
    ++calls;
    for (const NodeId node : scene.match("/Assets/*")) {
      scene.set_pose(node, Transform{Vec3(0, 0, calls), Quat::Identity(), Vec3::Ones()});
    }
  }
};

struct TakesAnything : Loader {
  using Params = NoParams;
  TakesAnything(Params, Host&) {}
  std::vector<std::string> claims() const override { return {".any", "Shelf:"}; }
  std::vector<std::string> assets() const override { return {"Shelf:1"}; }
  void load(std::string_view, Scene& scene, NodeId) override {
    scene.create(scene.root(), "stray");
  }
};

struct MovesTheFloor : PhysicsBackend {
  using Params = NoParams;
  MovesTheFloor(Params, Host&) {}
  double step_seconds() const override { return 0.01; }
  PhysicsReport report() const override { return {}; }
  void do_reset(const Scene&) override {}
  void do_advance(int) override {}
  void do_write_poses(Scene& scene) const override {
    for (const NodeId node : scene.match("/*/*")) {
      Affine pose = scene[node].parent_from_node;
      pose.translation().z() -= 0.1;
      scene.set_pose(node, pose);
    }
  }
};

/// Sees nothing, and something else each time.
struct Restless : Renderer {
  using Params = NoParams;
  Restless(Params, Host&) {}
  static inline std::uint8_t calls = 0;
  NameSet provides() const override { return {"color", "leaf_id", "distance_to_camera"}; }
  void do_prepare(const Scene& scene) override {
    const_cast<Scene&>(scene).create(scene.root(), "mark");
  }
  Frame do_render(const Scene& scene, const RenderRequest& request) override {
    const Camera& camera = *scene[request.camera].camera;
    Frame frame;
    ++calls;
    frame.set(kColor, Image<Rgba8>(camera.width, camera.height, {calls, 0, 0, 255}));
    frame.set(kLeafId, Image<std::uint32_t>(camera.width, camera.height, 0));
    frame.set(kDistanceToCamera, Image<float>(camera.width, camera.height, 0.0f));
    return frame;
  }
  std::vector<CoverageMask> do_cover(const Scene&, NodeId,
                                     std::span<const LabelledInstance> instances, bool) override {
    return std::vector<CoverageMask>(instances.size());
  }
};

struct PromisesEdges : Annotator {
  using Params = NoParams;
  PromisesEdges(Params, Host&) {}
  NameSet needs() const override { return {"color"}; }
  NameSet provides() const override { return {"edges"}; }
  void do_annotate(const Scene&, Frame&) const override {}
};

}  // namespace diorama::test

DIORAMA_PLUGIN("misbehaving_others", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(Forgetful, "forgetful", "Counts its calls.");
  DIORAMA_ADD_LOADER(TakesAnything, "takes_anything", "Loads what is not there.", ".any");
  DIORAMA_ADD(MovesTheFloor, "moves_the_floor", "Lowers everything.");
  DIORAMA_ADD(Restless, "restless", "Shows another colour each time.");
  DIORAMA_ADD_ANNOTATOR(PromisesEdges, "promises_edges", "Provides nothing.", "color", "edges");
}
