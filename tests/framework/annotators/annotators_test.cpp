// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <map>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"
#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"

using namespace diorama;
using test::SampleScene;

namespace {

const Instance& instance_at(const Frame& frame, const std::string& path) {
  const auto found = std::ranges::find(frame.instances, path, &Instance::node_path);
  REQUIRE(found != frame.instances.end());
  return *found;
}

/// A frame of 6 x 4 pixels whose leaf ids are given.
Frame frame_of(const std::vector<std::uint32_t>& leaves) {
  Frame frame;
  frame.camera.width = 6;
  frame.camera.height = 4;
  Image<std::uint32_t> image(6, 4, 0);
  std::ranges::copy(leaves, image.pixels().begin());
  frame.set(kLeafId, std::move(image));
  return frame;
}

std::shared_ptr<const Mesh> unit_box() {
  return std::make_shared<const Mesh>(make_box({1.0, 1.0, 1.0}));
}

}  // namespace

TEST_CASE("pixels take the id of the nearest labelled node above their surface", "[annotators]") {
  Scene scene;
  const NodeId outer = scene.create(scene.root(), "outer");
  const NodeId plain = scene.create(outer, "plain");
  const NodeId inner = scene.create(outer, "inner");
  const NodeId free = scene.create(scene.root(), "free");
  for (const NodeId node : {plain, inner, free}) scene.edit(node).mesh = unit_box();
  scene.edit(outer).labels = {{"class", "table"}};
  scene.edit(inner).labels = {{"shape", "leg"}};
  Frame frame = frame_of({0, plain.index, inner.index, free.index, 4000000000u});

  test::FakeHost host;
  InstanceIds({}, host).annotate(scene, frame);
  const auto& ids = frame.get(kInstanceId);
  CHECK(ids.at(0, 0) == 0);
  CHECK(ids.at(1, 0) == outer.index);
  CHECK(ids.at(2, 0) == inner.index);
  CHECK(ids.at(3, 0) == 0);
  CHECK(ids.at(4, 0) == 0);

  Instances({}, host).annotate(scene, frame);
  REQUIRE(frame.instances.size() == 2);
  CHECK(frame.instances[0].node_path == "/outer");
  CHECK(frame.instances[1].labels == Labels{{"class", "table"}, {"shape", "leg"}});
  CHECK(frame.instances[0].tight_box == PixelBox{1, 0, 2, 1});
  CHECK(frame.instances[1].tight_box == PixelBox{2, 0, 3, 1});
}

TEST_CASE("bounds are those of the instance's own visible meshes in its own space",
          "[annotators]") {
  Scene scene;
  const NodeId mug = scene.create(scene.root(), "mug");
  scene.edit(mug).labels = {{"class", "mug"}};
  scene.set_pose(
      mug,
      Transform{{5.0, 6.0, 7.0}, Quat(Eigen::AngleAxisd(0.6, Vec3::UnitX())), {2.0, 2.0, 3.0}});
  const NodeId body = scene.create(mug, "body");
  const NodeId handle = scene.create(mug, "handle");
  const NodeId lid = scene.create(mug, "lid");
  const NodeId badge = scene.create(mug, "badge");
  for (const NodeId node : {body, handle, lid, badge}) scene.edit(node).mesh = unit_box();
  scene.set_pose(handle, Transform{{1.0, 0.0, 0.25}, Quat::Identity(), {0.5, 0.5, 0.5}});
  scene.set_pose(lid, Transform{{0.0, 9.0, 0.0}, Quat::Identity(), Vec3::Ones()});
  scene.set_pose(badge, Transform{{0.0, -9.0, 0.0}, Quat::Identity(), Vec3::Ones()});
  scene.edit(lid).is_visible = false;
  scene.edit(badge).labels = {{"class", "badge"}};

  test::FakeHost host;
  Frame frame = frame_of({});
  InstanceIds({}, host).annotate(scene, frame);
  Instances({}, host).annotate(scene, frame);
  const Aabb& box = instance_at(frame, "/mug").bounds_node;
  CHECK((box.min - Vec3(-0.5, -0.5, -0.5)).norm() < 1e-9);
  CHECK((box.max - Vec3(1.25, 0.5, 0.5)).norm() < 1e-9);
  CHECK_FALSE(instance_at(frame, "/mug").tight_box.has_value());
}

TEST_CASE("visibility counts pixels inside and outside the image", "[annotators]") {
  Frame frame = frame_of({});
  Image<std::uint32_t> ids(6, 4, 0);
  ids.at(0, 1) = ids.at(1, 1) = 7;
  frame.set(kInstanceId, std::move(ids));
  frame.instances.resize(2);
  frame.instances[0].id = 7;
  frame.instances[1].id = 9;
  // Columns -1 to 2 of rows 1 and 2, without one corner.
  const CoverageMask seven{{-1, 1, 3, 3}, {1, 1, 1, 1, 1, 1, 1, 0}, {}};
  const CoverageMask nine{{6, -2, 8, -1}, {1, 1}, {}};
  const std::vector<CoverageMask> masks{seven, nine};

  measure_visibility(masks, true, frame);
  const Visibility& first = *frame.instances[0].visibility;
  CHECK(first.visible_pixels == 2);
  CHECK(first.amodal_pixels == 5);
  CHECK(first.outside_pixels == 2);
  CHECK(first.amodal_box == PixelBox{0, 1, 3, 3});
  CHECK(first.whole_box == PixelBox{-1, 1, 3, 3});
  CHECK(first.occlusion() == Approx(1.0 - 2.0 / 5.0));
  CHECK(first.truncation() == Approx(2.0 / 7.0));
  CHECK(first.amodal_mask.box == PixelBox{0, 1, 3, 3});
  CHECK(first.amodal_mask.bits == std::vector<std::uint8_t>{1, 1, 1, 1, 1, 0});
  const Visibility& second = *frame.instances[1].visibility;
  CHECK(second.outside_pixels == 2);
  CHECK_FALSE(second.amodal_box.has_value());
  CHECK(second.whole_box == PixelBox{6, -2, 8, -1});
  CHECK_FALSE(second.occlusion().has_value());

  // One after the other.
  frame.instances[0].visibility.reset();
  frame.instances[1].visibility.reset();
  VisibilityMeter meter(true, frame);
  meter.add(std::span(masks).first(1));
  CHECK(frame.instances[0].visibility->outside_pixels == 2);
  CHECK(frame.instances[0].visibility->amodal_mask.bits.size() == 6);
  CHECK_FALSE(frame.instances[1].visibility.has_value());
  meter.add(std::span(masks).last(1));
  CHECK(frame.instances[1].visibility->whole_box == PixelBox{6, -2, 8, -1});
  CHECK_THROWS_WITH(meter.add(std::span(masks).first(1)),
                    ContainsSubstring("more coverage masks than the 2 instances"));

  measure_visibility(masks, false, frame);
  CHECK(frame.instances[0].visibility->amodal_mask.bits.empty());
  CHECK_THROWS_WITH(measure_visibility(std::span(masks).first(1), false, frame),
                    ContainsSubstring("1 coverage masks for 2 instances"));
  const std::vector<CoverageMask> torn{seven, {{6, -2, 8, -1}, {1}, {}}};
  CHECK_THROWS_WITH(measure_visibility(torn, false, frame), ContainsSubstring("holds 1 values"));
}

TEST_CASE("the whole box is the extent of a mask of any shape", "[annotators]") {
  Frame frame = frame_of({});
  frame.set(kInstanceId, Image<std::uint32_t>(5, 4, 0));
  frame.instances.resize(1);
  frame.instances[0].id = 7;
  std::uint32_t random = 1;
  for (int i = 0; i < 200; ++i) {
    CoverageMask mask{{-4, -3, 9, 7}, std::vector<std::uint8_t>(13 * 10, 0), {}};
    for (int bits = i % 7; bits > 0; --bits) {
      random = random * 1664525u + 1013904223u;
      mask.bits[(random >> 8) % mask.bits.size()] = 1;
    }
    measure_visibility(std::span(&mask, 1), false, frame);
    const Visibility& visibility = *frame.instances[0].visibility;
    CHECK(visibility.whole_box.value_or(PixelBox{}) == mask.extent());
    const PixelBox image{0, 0, 5, 4};
    CHECK(visibility.amodal_box.value_or(PixelBox{}) == mask.cropped(image).extent());
  }
}

TEST_CASE("occlusion order says in how many pixels one is in front of another", "[annotators]") {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  Frame frame = frame_of({});
  Image<std::uint32_t> ids(4, 1, 0);
  ids.at(2, 0) = 9;
  frame.set(kInstanceId, std::move(ids));
  frame.instances.resize(3);
  frame.instances[0].id = 7;
  frame.instances[1].id = 9;
  frame.instances[2].id = 4;
  // Column:              -1    0    1    2    3
  const CoverageMask seven{{-1, 0, 4, 1}, {1, 1, 1, 1, 0}, {1.0f, 2.0f, 5.0f, 3.0f, kFar}};
  const CoverageMask nine{{-1, 0, 3, 1}, {1, 1, 1, 1}, {2.0f, 3.0f, 4.0f, 3.0f}};
  // Touches the first at the same distance, behind what hides both or nothing.
  const CoverageMask four{{1, 0, 4, 1}, {1, 0, 1}, {5.0f, kFar, 6.0f}};
  std::vector<CoverageMask> masks{seven, nine, four};

  order_occlusions(masks, frame);
  // Column -1 is outside the image; in column 2 the picture decides between equals, in column 1
  // between 7 and 4 nothing does.
  const std::vector<Occlusion> expected{{7, 9, 1}, {9, 7, 2}, {9, 4, 1}};
  CHECK(frame.occlusions == expected);

  // What lies beside the image does not matter.
  const Camera camera = Camera::from_lens(4, 1, 24.0, 20.955);
  std::vector<CoverageMask> inside;
  for (const CoverageMask& mask : masks) inside.push_back(inside_image(mask, camera));
  CHECK(inside[0].box == PixelBox{0, 0, 4, 1});
  CHECK(inside[0].distances == std::vector<float>{2.0f, 5.0f, 3.0f, kFar});
  CHECK(inside[2].box == masks[2].box);
  CHECK(inside_image({{-3, 0, -1, 1}, {1, 1}, {1.0f, 1.0f}}, camera).bits.empty());
  order_occlusions(inside, frame);
  CHECK(frame.occlusions == expected);

  CHECK_THROWS_WITH(order_occlusions(std::span(masks).first(1), frame),
                    ContainsSubstring("1 coverage masks for 3 instances"));
  masks[1].distances.clear();
  CHECK_THROWS_WITH(order_occlusions(masks, frame), ContainsSubstring("has no distances"));
}

TEST_CASE("labels of a rendered scene agree with each other", "[annotators]") {
  const SampleScene sample;
  for (const NodeId camera : sample.cameras) {
    const Frame frame = test::ray_cast(sample.scene, camera);
    const auto& ids = frame.get(kInstanceId);
    std::map<std::uint32_t, std::int64_t> counts;
    for (const std::uint32_t id : ids.pixels()) ++counts[id];
    for (const Instance& instance : frame.instances) {
      const Visibility& visibility = *instance.visibility;
      CHECK(visibility.visible_pixels == counts[instance.id]);
      CHECK(visibility.visible_pixels <= visibility.amodal_pixels);
      CHECK(instance.tight_box.has_value() == (visibility.visible_pixels > 0));
      if (instance.tight_box) {
        CHECK(visibility.amodal_box->x_min <= instance.tight_box->x_min);
        CHECK(visibility.amodal_box->y_max >= instance.tight_box->y_max);
      }
    }
    // The scene holds each case on purpose.
    CHECK(instance_at(frame, "/Assets/hidden").visibility->visible_pixels == 0);
  }
  const Frame first = test::ray_cast(sample.scene, sample.cameras[0]);
  CHECK(instance_at(first, "/Assets/mug").visibility->occlusion().value() > 0.1);
  CHECK(instance_at(first, "/Assets/hidden").visibility->occlusion() == 1.0);
  CHECK(instance_at(first, "/Assets/ball").visibility->truncation() > 0.1);
}

TEST_CASE("object coordinates map back onto the surface", "[annotators]") {
  const SampleScene sample;
  const Frame frame = test::ray_cast(sample.scene, sample.cameras[0]);
  const auto& coordinates = frame.get(kObjectCoordinates);
  const auto& positions = frame.get(kPosition);
  int checked = 0;
  for (std::size_t i = 0; i < coordinates.pixels().size(); ++i) {
    const std::uint32_t id = frame.get(kInstanceId).pixels()[i];
    if (id == 0) {
      CHECK(coordinates.pixels()[i].isZero(0.0f));
      continue;
    }
    const auto instance = std::ranges::find(frame.instances, id, &Instance::id);
    const Aabb& box = instance->bounds_node;
    const Vec3 unit = coordinates.pixels()[i].cast<double>();
    const Vec3 world = instance->world_from_node * (box.min + unit.cwiseProduct(box.size()));
    CHECK((world - positions.pixels()[i].cast<double>()).norm() < 1e-5);
    ++checked;
  }
  CHECK(checked > 100);
}
