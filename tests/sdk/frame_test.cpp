// SPDX-License-Identifier: Apache-2.0
#include "diorama/frame.h"

#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

TEST_CASE("A frame gives back the channels that were put in", "[frame]") {
  Frame frame;
  frame.camera_path = "/Cameras/cam_1";
  Image<float> distance(3, 2, 1.5f);
  distance.at(1, 1) = 4.0f;
  frame.set(kDistanceToCamera, distance);
  CHECK(frame.get(kDistanceToCamera) == distance);
  CHECK(frame.has("distance_to_camera"));
  CHECK_FALSE(frame.has("color"));
  CHECK(frame.channels() == NameSet{"distance_to_camera"});
  frame.set(kDistanceToCamera, Image<float>(1, 1, 0.0f));
  CHECK(frame.get(kDistanceToCamera).width() == 1);
}

TEST_CASE("Asking for an absent channel names those that are there", "[frame]") {
  Frame frame;
  frame.camera_path = "/Cameras/cam_1";
  CHECK(test::error_text([&] { frame.get(kColor); }) ==
        "/Cameras/cam_1: there is no channel 'color'; there are: none");
  frame.set(kLeafId, Image<std::uint32_t>(1, 1, 0));
  frame.set(kUv, Image<Vec2f>(1, 1, Vec2f::Zero()));
  CHECK(test::error_text([&] { frame.get(kColor); }) ==
        "/Cameras/cam_1: there is no channel 'color'; there are: leaf_id, uv");
}

TEST_CASE("Asking for a channel as another type is an error", "[frame]") {
  Frame frame;
  frame.camera_path = "/Cameras/cam_1";
  frame.set(Channel<float>{"color"}, Image<float>(1, 1, 0.0f));
  CHECK(test::error_text([&] { frame.get(kColor); }) ==
        "/Cameras/cam_1: channel 'color' has another pixel type");
}

TEST_CASE("A coverage mask is addressed in image coordinates", "[frame]") {
  CoverageMask mask;
  mask.box = {-2, 3, 1, 5};
  mask.bits = {1, 0, 0, 0, 0, 1};
  CHECK(mask.covers(-2, 3));
  CHECK(mask.covers(0, 4));
  CHECK_FALSE(mask.covers(-1, 3));
  CHECK_FALSE(mask.covers(1, 4));
  CHECK_FALSE(mask.covers(-3, 3));
}

TEST_CASE("A coverage mask shrinks to what is covered, distances with it", "[frame]") {
  CoverageMask mask;
  mask.box = {-2, 3, 2, 6};
  mask.bits = {0, 0, 0, 0,  //
               0, 1, 0, 0,  //
               0, 0, 1, 0};
  for (int i = 0; i < 12; ++i) mask.distances.push_back(float(i));
  CHECK(mask.extent() == PixelBox{-1, 4, 1, 6});
  const CoverageMask small = mask.cropped(mask.extent());
  CHECK(small.box == mask.extent());
  CHECK(small.bits == std::vector<std::uint8_t>{1, 0, 0, 1});
  CHECK(small.distances == std::vector<float>{5, 6, 9, 10});

  mask.bits.assign(12, 0);
  CHECK(mask.extent() == PixelBox{});
  CHECK(mask.cropped(mask.extent()).bits.empty());
}

TEST_CASE("Occlusion and truncation are shares of the covered pixels", "[frame]") {
  Visibility visibility;
  CHECK_FALSE(visibility.occlusion());
  CHECK(visibility.truncation() == 1.0);
  visibility.visible_pixels = 30;
  visibility.amodal_pixels = 40;
  visibility.outside_pixels = 10;
  CHECK(*visibility.occlusion() == Approx(0.25));
  CHECK(visibility.truncation() == Approx(0.2));
}
