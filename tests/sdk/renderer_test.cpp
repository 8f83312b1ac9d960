// SPDX-License-Identifier: Apache-2.0
#include "diorama/renderer.h"

#include <functional>

#include "diorama/geometry.h"
#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// Gives what the test asks it to give.
class Scripted final : public Renderer {
 public:
  std::function<Frame()> frame;
  std::vector<CoverageMask> masks;
  NameSet provides() const override { return {"color", "leaf_id", "heat"}; }

 private:
  void do_prepare(const Scene&) override {}
  Frame do_render(const Scene&, const RenderRequest&) override { return frame(); }
  std::vector<CoverageMask> do_cover(const Scene&, NodeId, std::span<const LabelledInstance>,
                                     bool) override {
    return masks;
  }
};

struct Studio {
  Scene scene;
  NodeId rig = scene.create(scene.root(), "rig");
  NodeId camera = scene.create(rig, "cam_0");
  NodeId cup = scene.create(scene.root(), "cup");
  Scripted renderer;

  Studio() {
    Camera lens;
    lens.width = 3;
    lens.height = 2;
    scene.edit(camera).camera = lens;
    scene.set_pose(rig, Affine(Eigen::Translation3d(1, 2, 3)));
    renderer.prepare(scene);
  }
  std::string render_error(const NameSet& channels) {
    return test::error_text([&] { renderer.render({camera, channels, 1}); });
  }
  std::string cover_error(bool with_distances = false) {
    const std::vector<LabelledInstance> instances = {{cup, {cup}}};
    return test::error_text([&] { renderer.cover(camera, instances, with_distances); });
  }
};

Frame with_ids(int width, int height, std::uint32_t id) {
  Frame frame;
  frame.set(kLeafId, Image<std::uint32_t>(width, height, id));
  return frame;
}

}  // namespace

TEST_CASE("A rendered frame knows its camera and its leaves", "[renderer]") {
  Studio s;
  s.renderer.frame = [&] { return with_ids(3, 2, s.cup.index); };
  const Frame frame = s.renderer.render({s.camera, {"leaf_id"}, 1});
  CHECK(frame.camera_name == "cam_0");
  CHECK(frame.camera_path == "/rig/cam_0");
  CHECK(frame.camera.width == 3);
  CHECK(frame.world_from_camera.translation() == Vec3(1, 2, 3));
  CHECK(frame.seed == 1);
  CHECK(frame.leaf_paths == std::map<std::uint32_t, std::string>{{s.cup.index, "/cup"}});
}

TEST_CASE("A bad request is refused before anything is rendered", "[renderer]") {
  Studio s;
  s.renderer.frame = []() -> Frame { throw std::logic_error("rendered"); };
  CHECK(s.render_error({"normals"}) == "Renderer: channel 'normals' is not provided");
  CHECK(test::error_text([&] {
          s.renderer.render({s.cup, {}, 1});
        }) == "/cup: the node has no camera");
  CHECK(test::error_text([&] {
          s.renderer.render({NodeId{99}, {}, 1});
        }) == "Renderer: the camera's node is not in the scene");
  s.scene.edit(s.camera).camera->width = 0;
  CHECK(s.render_error({}) ==
        "/rig/cam_0: expected an image of at least 1 x 1 pixels, found 0 x 2");
  Scripted unprepared;
  CHECK(test::error_text([&] {
          unprepared.render({s.camera, {}, 1});
        }) == "Renderer: prepare() was not called before");
}

TEST_CASE("A renderer's result is checked", "[renderer]") {
  Studio s;
  s.renderer.frame = [] { return Frame(); };
  CHECK(s.render_error({"leaf_id"}) ==
        "/rig/cam_0: there is no channel 'leaf_id'; there are: none");
  s.renderer.frame = [] { return with_ids(2, 3, 0); };
  CHECK(s.render_error({"leaf_id"}) ==
        "/rig/cam_0: channel 'leaf_id' has 2 x 3 pixels, expected 3 x 2");
  s.renderer.frame = [] { return with_ids(3, 2, 77); };
  CHECK(s.render_error({"leaf_id"}) == "Renderer: leaf id 77 is no node of the scene");
  s.renderer.frame = [] {
    Frame frame;
    frame.set(Channel<float>{"leaf_id"}, Image<float>(3, 2, 0.0f));
    return frame;
  };
  CHECK(s.render_error({"leaf_id"}) == "/rig/cam_0: channel 'leaf_id' has another pixel type");
}

TEST_CASE("Coverage masks are checked", "[renderer]") {
  Studio s;
  CHECK(s.cover_error() == "Renderer: expected 1 coverage masks, found 0");
  s.renderer.masks = {CoverageMask{}};
  CHECK(s.cover_error() == "(no error)");
  s.renderer.masks = {CoverageMask{{-3, -2, 6, 4}, std::vector<std::uint8_t>(54, 1), {}}};
  CHECK(s.cover_error() == "(no error)");
  s.renderer.masks = {CoverageMask{{-4, 0, 0, 1}, std::vector<std::uint8_t>(4, 1), {}}};
  CHECK(s.cover_error() == "/cup: the box of its coverage mask is out of reach");
  s.renderer.masks = {CoverageMask{{0, 0, 2, 1}, {1}, {}}};
  CHECK(s.cover_error() == "/cup: its coverage mask has 1 pixels, its box has 2 x 1");
  s.renderer.masks = {CoverageMask{{0, 0, 2, 1}, {1, 0}, {}}};
  CHECK(s.cover_error(true) == "/cup: its coverage mask has 0 distances, expected 2");
  s.renderer.masks = {CoverageMask{{0, 0, 2, 1}, {1, 0}, {0.5f, 7.0f}}};
  CHECK(s.cover_error(true) == "(no error)");
  CHECK(s.cover_error() == "/cup: its coverage mask has 2 distances, expected none");
}

TEST_CASE("A renderer that cannot trace tells by triangles which points are seen", "[renderer]") {
  Studio studio;
  // Between the camera at (1, 2, 3) and half of the points.
  studio.scene.edit(studio.cup).mesh = std::make_shared<const Mesh>(make_box(Vec3(1, 1, 0.2)));
  studio.scene.set_pose(studio.cup, Affine(Eigen::Translation3d(1.5, 2, 2)));
  studio.renderer.prepare(studio.scene);
  const std::vector<Vec3> points{{1.2, 2, 0}, {0.2, 2, 0}, {1.5, 2, 2.1}, {1.5, 2, 1.9}, {1, 2, 3}};
  CHECK(studio.renderer.sees(studio.camera, points) == std::vector<std::uint8_t>{0, 1, 1, 0, 1});
  studio.scene.edit(studio.cup).is_visible = false;
  studio.renderer.prepare(studio.scene);
  CHECK(studio.renderer.sees(studio.camera, points) == std::vector<std::uint8_t>{1, 1, 1, 1, 1});
  CHECK(test::error_text([&] { studio.renderer.sees(studio.cup, points); }) ==
        "/cup: the node has no camera");
}
