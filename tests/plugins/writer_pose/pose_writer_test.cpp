// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_writer.h"

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/memory_files.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"
#include "writer_support/python_json.h"

using namespace diorama;
using test::FakeHost;
using test::MemoryFiles;
using test::SampleScene;

namespace {

const Capture& sample_capture() {
  static const Capture capture = test::ray_cast_capture(SampleScene(96, 64, 2), 2);
  return capture;
}

MemoryFiles write(const PoseWriter::Params& params, const Capture& capture = sample_capture()) {
  FakeHost host;
  PoseWriter writer(params, host);
  return test::write_dataset(writer, test::sample_dataset(SampleScene(8, 6)), {&capture});
}

}  // namespace

TEST_CASE("cameras take turns in one folder or have their own", "[writers]") {
  PoseWriter::Params params;
  CHECK(write(params).paths() == std::set<std::string>{"metadata.txt", "000004.json", "000004.png",
                                                       "000005.json", "000005.png"});
  params.use_subfolders = params.write_debug_images = true;
  params.image_output_format = "jpg";
  CHECK(write(params).paths() ==
        std::set<std::string>{"metadata.txt", "rp_cam_0/000002.json", "rp_cam_0/000002.jpg",
                              "rp_cam_0/000002_overlay.jpg", "rp_cam_1/000002.json",
                              "rp_cam_1/000002.jpg", "rp_cam_1/000002_overlay.jpg"});
}

TEST_CASE("hidden objects are left out, the rest carries its visible share", "[writers]") {
  const Json json = Json::parse(write({}).text("000004.json"));
  std::map<std::string, double> visibility;
  for (const Json& object : json["objects"]) {
    visibility[object["prim_path"]] = object["visibility"];
  }
  CHECK(visibility.size() == 3);
  CHECK(visibility.at("/Assets/mug") < 0.9);
  CHECK(visibility.at("/Assets/mug") > 0.0);

  PoseWriter::Params params;
  params.visibility_threshold = 1.0;
  CHECK(write(params).paths() == std::set<std::string>{"metadata.txt"});
  params.skip_empty_frames = false;
  const Json empty = Json::parse(write(params).text("000005.json"));
  CHECK(empty["objects"].empty());
  CHECK(write(params).text("000005.json").ends_with("\"objects\": []\n}"));
}

TEST_CASE("keypoints land where the camera sees the box's corners", "[writers]") {
  const Capture& capture = sample_capture();
  const Json json = Json::parse(write({}).text("000005.json"));
  const Frame& frame = capture.frames[1];
  for (const Json& object : json["objects"]) {
    const auto instance = std::ranges::find(frame.instances, object["prim_path"].get<std::string>(),
                                            &Instance::node_path);
    REQUIRE(instance != frame.instances.end());
    const Aabb& box = instance->bounds_node;
    // "RDF": max x, min y, max z.
    const Vec3 world = instance->world_from_node * Vec3(box.max.x(), box.min.y(), box.max.z());
    const Vec2 pixel = project(frame.camera, frame.world_from_camera.inverse() * world).value();
    CHECK(json["keypoint_order"][6] == "RDF");
    CHECK(object["cuboid_keypoints_projected"][6][0] == std::lround(pixel.x()));
    CHECK(object["cuboid_keypoints_projected"][6][1] == std::lround(pixel.y()));
  }
}

TEST_CASE("an unknown format is refused", "[writers]") {
  FakeHost host;
  PoseWriter::Params params;
  params.format = "yolo";
  CHECK_THROWS_WITH(PoseWriter(params, host),
                    ContainsSubstring("expected null, dope or centerpose, found 'yolo'"));
}
