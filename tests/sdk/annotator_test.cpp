// SPDX-License-Identifier: Apache-2.0
#include "diorama/annotator.h"

#include <functional>
#include <utility>

#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

constexpr Channel<float> kHeat{"heat"};

/// Needs the colour, provides "heat" and whatever else is asked for, and does what it is told.
class Obedient final : public Annotator {
 public:
  explicit Obedient(std::function<void(Frame&)> act, NameSet provides = {"heat"})
      : act_(std::move(act)), provides_(std::move(provides)) {}
  NameSet needs() const override { return {"color"}; }
  NameSet provides() const override { return provides_; }

 private:
  void do_annotate(const Scene&, Frame& frame) const override { act_(frame); }
  std::function<void(Frame&)> act_;
  NameSet provides_;
};

Frame frame_of(int width, int height) {
  Frame frame;
  frame.camera_path = "/Cameras/cam_1";
  frame.camera.width = width;
  frame.camera.height = height;
  frame.set(kColor, Image<Rgba8>(width, height, {1, 2, 3, 255}));
  frame.set(kUv, Image<Vec2f>(width, height, Vec2f::Zero()));
  return frame;
}

std::string complaint(const std::function<void(Frame&)>& act, NameSet provides = {"heat"}) {
  Frame frame = frame_of(4, 3);
  return test::error_text([&] { Obedient(act, std::move(provides)).annotate(Scene(), frame); });
}

void set_heat(Frame& frame) { frame.set(kHeat, Image<float>(4, 3, 1.0f)); }

}  // namespace

TEST_CASE("An annotator sees what it needs and what it provides, and nothing else", "[annotator]") {
  Frame frame = frame_of(4, 3);
  const Obedient annotator([](Frame& lent) {
    CHECK(lent.has("color"));
    CHECK_FALSE(lent.has("uv"));
    CHECK(lent.channels() == NameSet{"color"});
    set_heat(lent);
    CHECK(lent.get(kHeat).at(1, 1) == 1.0f);
  });
  annotator.annotate(Scene(), frame);
  CHECK(frame.channels() == NameSet{"color", "heat", "uv"});
  frame.set(kNormals, Image<Vec3f>(4, 3, Vec3f::Zero()));  // the frame's owner may set anything
}

TEST_CASE("What an annotator reads without asking is refused", "[annotator]") {
  CHECK(complaint([](Frame& frame) { frame.get(kUv); }) ==
        "/Cameras/cam_1: reads the channel 'uv', which is not among those that it says it needs");
}

TEST_CASE("What an annotator sets without saying so is refused", "[annotator]") {
  const std::string text =
      "/Cameras/cam_1: sets the channel 'color', which is not among those that it says it provides";
  CHECK(complaint([](Frame& frame) { frame.set(kColor, Image<Rgba8>(4, 3, {})); }) == text);
  // A frame that was refused serves its owner as before.
  Frame frame = frame_of(4, 3);
  const Obedient bad([](Frame& lent) { lent.set(kColor, Image<Rgba8>(4, 3, {})); });
  CHECK(test::error_text([&] { bad.annotate(Scene(), frame); }) == text);
  CHECK(frame.get(kColor).at(0, 0) == Rgba8{1, 2, 3, 255});
  CHECK(frame.has("uv"));
}

TEST_CASE("What an annotator provides must be there, of the picture's size and of its type",
          "[annotator]") {
  CHECK(complaint([](Frame&) {}) ==
        "/Cameras/cam_1: there is no channel 'heat'; there are: color, uv");
  CHECK(complaint([](Frame& frame) { frame.set(kHeat, Image<float>(3, 4, 1.0f)); }) ==
        "/Cameras/cam_1: channel 'heat' has 3 x 4 pixels, expected 4 x 3");
  CHECK(complaint(
            [](Frame& frame) {
              frame.set(Channel<float>{"sensor_depth"}, Image<float>(4, 3, 1.0f));
              frame.set(Channel<float>{"motion"}, Image<float>(4, 3, 1.0f));
            },
            {"sensor_depth", "motion"}) ==
        "/Cameras/cam_1: channel 'motion' has another pixel type");
  CHECK(complaint([](Frame& frame) { frame.instances.emplace_back(); }, {"instances"}) ==
        "(no error)");
}

TEST_CASE("An annotator that replaces the frame is found out", "[annotator]") {
  const auto replace = [](Frame& frame) {
    frame = frame_of(4, 3);
    set_heat(frame);
  };
  CHECK(complaint(replace) == "(no error)");  // nothing is lost
  CHECK(complaint([&](Frame& frame) {
          frame = Frame();
          frame.camera.width = 4;
          frame.camera.height = 3;
          set_heat(frame);
        }) == ": there is no channel 'color'; there are: heat");
}
