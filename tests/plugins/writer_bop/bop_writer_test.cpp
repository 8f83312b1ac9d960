// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_writer.h"

#include <cstring>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

namespace {

MemoryFiles write() {
  test::FakeHost host;
  return test::write_sample<BopWriter>({}, host);
}

std::string scene_of(const MemoryFiles& files, int capture, int camera) {
  return (test::split_of(files, capture) == "val" ? "test/00000" : "train_pbr/00000") +
         std::to_string(camera);
}

}  // namespace

TEST_CASE("poses carry model points to where the camera sees them", "[writers]") {
  const MemoryFiles files = write();
  for (const Capture& capture : test::sample_captures()) {
    for (int camera = 0; camera < 2; ++camera) {
      const Frame& frame = capture.frames[std::size_t(camera)];
      const std::string scene = scene_of(files, capture.index, camera);
      const std::string id = std::to_string(capture.index);
      const Json poses = Json::parse(files.text(scene + "/scene_gt.json")).at(id);
      const Json k = Json::parse(files.text(scene + "/scene_camera.json")).at(id).at("cam_K");
      CHECK_FALSE(poses.empty());
      for (const Json& pose : poses) {
        const Instance& instance = test::instance_at(frame, pose.at("node"));
        const Vec3 local = instance.bounds_node.corner(3);
        Mat3 rotation;
        Vec3 translation, scale;
        for (int i = 0; i < 9; ++i) {
          rotation(i / 3, i % 3) = pose.at("cam_R_m2c")[std::size_t(i)].get<double>();
        }
        for (int i = 0; i < 3; ++i) {
          translation[i] = pose.at("cam_t_m2c")[std::size_t(i)].get<double>();
          scale[i] = pose.at("scale")[std::size_t(i)].get<double>();
        }
        CHECK(rotation.determinant() == Approx(1.0));
        const Vec3 point = rotation * (1000.0 * scale.cwiseProduct(local)) + translation;
        const Vec2 pixel(k[0].get<double>() * point.x() / point.z() + k[2].get<double>(),
                         k[4].get<double>() * point.y() / point.z() + k[5].get<double>());
        const Vec2 expected = project(frame.camera, frame.world_from_camera.inverse() *
                                                        (instance.world_from_node * local))
                                  .value();
        CHECK((pixel - expected).norm() < 1e-6);
      }
    }
  }
}

TEST_CASE("masks and their counts agree", "[writers]") {
  const MemoryFiles files = write();
  const std::string scene = scene_of(files, 0, 0);
  const Json infos = Json::parse(files.text(scene + "/scene_gt_info.json")).at("0");
  const Json poses = Json::parse(files.text(scene + "/scene_gt.json")).at("0");
  REQUIRE(infos.size() == poses.size());
  for (std::size_t i = 0; i < infos.size(); ++i) {
    const std::string name = "/000000_00000" + std::to_string(i) + ".png";
    const test::RawImage visible = test::raw_image(files.bytes(scene + "/mask_visib" + name));
    const test::RawImage whole = test::raw_image(files.bytes(scene + "/mask" + name));
    std::int64_t visible_count = 0;
    std::int64_t whole_count = 0;
    for (int y = 0; y < visible.height; ++y) {
      for (int x = 0; x < visible.width; ++x) {
        if (visible.at(x, y, 0) == 255) ++visible_count;
        if (whole.at(x, y, 0) == 255) ++whole_count;
        CHECK(visible.at(x, y, 0) <= whole.at(x, y, 0));
      }
    }
    CHECK(infos[i].at("px_count_visib") == visible_count);
    CHECK(infos[i].at("px_count_all") == whole_count);
    CHECK(infos[i].at("visib_fract").get<double>() ==
          Approx(double(visible_count) / double(whole_count)));
  }
}

TEST_CASE("depth is in units of depth_scale millimetres", "[writers]") {
  const MemoryFiles files = write();
  const test::RawImage picture =
      test::raw_image(files.bytes(scene_of(files, 1, 1) + "/depth/000001.png"));
  const auto& depth = test::sample_captures()[1].frames[1].get(kDistanceToImagePlane);
  CHECK(picture.at(30, 30, 0) == std::lround(10000.0 * depth.at(30, 30)));
  const Json camera = Json::parse(files.text("camera.json"));
  CHECK(camera.at("depth_scale") == 0.1);
  CHECK(camera.at("width") == 72);
}

TEST_CASE("a model is the asset's shape in millimetres", "[writers]") {
  const MemoryFiles files = write();
  const Json info = Json::parse(files.text("models/models_info.json")).at("3");
  const std::string ply = files.text("models/obj_000003.ply");
  CHECK(ply.starts_with("ply\nformat binary_little_endian 1.0\n"));
  const std::string end = "end_header\n";
  const std::size_t data = ply.find(end) + end.size();
  const auto count = [&](const std::string& element) {
    return std::stoul(ply.substr(ply.find("element " + element + " ") + element.size() + 9));
  };
  REQUIRE(ply.size() == data + 27 * count("vertex") + 13 * count("face"));
  Aabb box;
  std::vector<Vec3f> points(count("vertex"));
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::memcpy(points[i].data(), &ply[data + 27 * i], 12);
    box.add(points[i].cast<double>());
  }
  const Instance& mug = test::instance_at(test::sample_captures()[0].frames[0], "/Assets/mug");
  CHECK(box.min.isApprox(1000.0 * mug.bounds_node.min, 1e-5));
  CHECK(box.max.isApprox(1000.0 * mug.bounds_node.max, 1e-5));
  CHECK(info.at("size_z").get<double>() == Approx(box.size().z()));
  double diameter = 0.0;
  for (const Vec3f& a : points) {
    for (const Vec3f& b : points) diameter = std::max(diameter, double((a - b).norm()));
  }
  CHECK(info.at("diameter").get<double>() == Approx(diameter));
  CHECK(diameter < box.size().norm());
  CHECK_FALSE(files.files.contains("models/obj_000002.ply"));
}

TEST_CASE("several models of one class are objects of their own", "[writers]") {
  class TwoMugs final : public test::FakeHost {
   public:
    NodeId load_asset(std::string_view asset, Scene& scene, NodeId parent) override {
      if (asset == "/props/mug.usd") return FakeHost::load_asset(asset, scene, parent);
      const NodeId node = scene.create(parent, "cup");
      scene.edit(node).mesh = std::make_shared<const Mesh>(make_box({0.05, 0.06, 0.07}));
      return node;
    }
  };
  TwoMugs host;
  DatasetInfo dataset = test::sample_dataset(test::SampleScene(8, 6));
  dataset.assets.insert(dataset.assets.begin(), {"/props/cup.usd", {{{"class", "mug"}}}, {}});
  BopWriter writer({}, host);
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  const MemoryFiles files = test::write_dataset(writer, dataset, captures);
  const Json names = Json::parse(files.text("objects.json"));
  CHECK(names == Json{{"1", "ball"}, {"2", "crate"}, {"3", "mug"}, {"4", "mug"}});
  const Json models = Json::parse(files.text("models/models_info.json"));
  CHECK(models.at("3").at("size_z").get<double>() == Approx(70.0));
  CHECK(files.files.contains("models/obj_000003.ply"));
  CHECK(files.files.contains("models/obj_000004.ply"));
  for (const Json& pose :
       Json::parse(files.text(scene_of(files, 0, 0) + "/scene_gt.json")).at("0")) {
    if (pose.at("node") == "/Assets/mug") CHECK(pose.at("obj_id") == 4);
  }
}

TEST_CASE("models and targets name objects by their class numbers", "[writers]") {
  const MemoryFiles files = write();
  const Json models = Json::parse(files.text("models/models_info.json"));
  CHECK(models.at("2").at("size_x").get<double>() == Approx(400.0));
  CHECK(models.at("2").at("min_y").get<double>() == Approx(-150.0));
  CHECK(models.at("2").at("diameter").get<double>() == Approx(538.516).margin(1e-2));
  CHECK(Json::parse(files.text("objects.json")).at("2") == "crate");
  for (const Json& target : Json::parse(files.text("test_targets_bop19.json"))) {
    CHECK(test::split_of(files, target.at("im_id")) == "val");
    CHECK(target.at("inst_count") == 1);
  }
}
