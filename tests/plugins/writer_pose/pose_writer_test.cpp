// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_writer.h"

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/keypoint_sample.h"
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

TEST_CASE("named keypoints are told on demand, where the camera has them", "[writers]") {
  const test::KeypointSample named;
  FakeHost host;
  PoseWriter::Params params;
  for (const char* format : {"none", "dope", "centerpose"}) {
    params.format = format;
    params.named_keypoints = false;
    PoseWriter plain(params, host);
    const auto without = test::write_dataset(plain, named.dataset, {&named.capture});
    CHECK(without.text("000000.json").find("named_keypoints") == std::string::npos);
    params.named_keypoints = true;
    PoseWriter writer(params, host);
    CHECK(writer.needs().contains(kDistanceToCamera.name));
    const auto files = test::write_dataset(writer, named.dataset, {&named.capture});
    int crates = 0;
    const Json json = Json::parse(files.text("000000.json"));
    for (const Json& object : json["objects"]) {
      if (object["prim_path"] != "/Assets/crate") {
        CHECK_FALSE(object.contains("named_keypoints"));
        continue;
      }
      ++crates;
      const Json& points = object["named_keypoints"];
      REQUIRE(points.size() == 3);
      CHECK(points[0]["name"] == "hidden");
      CHECK(points[0]["visibility"] == 1);
      CHECK(points[1]["visibility"] == 2);
      CHECK(points[2]["visibility"] == 0);
      CHECK(points[1]["projected"][0].get<double>() == Approx(named.pixel.x()).margin(2e-3));
      // Both lie on one ray, which begins at the camera.
      const auto place = [&](std::size_t i) {
        const Json& list = points[i]["location_camera_frame"];
        return Vec3(list[0].get<double>(), list[1].get<double>(), list[2].get<double>());
      };
      CHECK(place(0).norm() - place(1).norm() == Approx(0.05).margin(1e-5));
      CHECK(place(0).cross(place(1)).norm() < 1e-5);
      CHECK(place(1).z() < 0.0);
    }
    CHECK(crates == 1);
  }
}
