// SPDX-License-Identifier: Apache-2.0
#include "writer_kitti/kitti_writer.h"

#include <sstream>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

namespace {

struct Line {
  std::string type;
  std::vector<double> values;  ///< truncated occluded alpha box dimensions location rotation
};

std::vector<Line> lines_of(const std::string& text) {
  std::vector<Line> lines;
  std::istringstream in(text);
  for (std::string row; std::getline(in, row);) {
    std::istringstream words(row);
    Line line;
    words >> line.type;
    for (double value = 0.0; words >> value;) line.values.push_back(value);
    lines.push_back(line);
  }
  return lines;
}

}  // namespace

TEST_CASE("cameras take turns and every picture has its files", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<KittiWriter>({}, host);
  for (const char* number : {"000000", "000001", "000005"}) {
    for (const char* path :
         {"image_2/%s.png", "label_2/%s.txt", "calib/%s.txt", "depth_2/%s.png"}) {
      std::string name = std::string("training/") + path;
      name.replace(name.find("%s"), 2, number);
      CHECK(files.paths().contains(name));
    }
  }
  CHECK(files.text("ImageSets/trainval.txt") == "000000\n000001\n000002\n000003\n000004\n000005\n");
  CHECK(files.text("ImageSets/train.txt").size() + files.text("ImageSets/val.txt").size() ==
        files.text("ImageSets/trainval.txt").size());
}

TEST_CASE("a stereo pair is image_2 and image_3, and P3 holds the baseline", "[writers]") {
  test::SampleScene sample(24, 16, 2);
  const Affine rig = sample.scene.world_from_node(sample.cameras[0]);
  sample.scene.set_pose(sample.cameras[1], rig * Eigen::Translation3d(0.54, 0, 0));
  sample.scene.edit(sample.cameras[1]).camera = *sample.scene[sample.cameras[0]].camera;
  Capture capture = test::ray_cast_capture(sample, 0);
  test::FakeHost host;
  KittiWriter::Params params;
  params.layout = "stereo";
  KittiWriter writer(params, host);
  const MemoryFiles files = test::write_dataset(writer, test::sample_dataset(sample), {&capture});
  for (const char* name : {"image_2/000000.png", "image_3/000000.png", "label_2/000000.txt"}) {
    CHECK(files.paths().contains(std::string("training/") + name));
  }
  CHECK(files.bytes("training/image_2/000000.png") != files.bytes("training/image_3/000000.png"));
  CHECK_FALSE(files.paths().contains("training/image_2/000001.png"));
  CHECK(files.text("ImageSets/trainval.txt") == "000000\n000001\n000002\n");
  std::istringstream text(files.text("training/calib/000000.txt"));
  const double fx = capture.frames[0].camera.fx;
  for (std::string row; std::getline(text, row);) {
    std::istringstream words(row);
    std::string key;
    std::vector<double> p;
    words >> key;
    for (double value = 0.0; words >> value;) p.push_back(value);
    if (key.front() != 'P') continue;
    CAPTURE(row);
    const bool is_right = key == "P1:" || key == "P3:";
    CHECK(p.at(3) == Approx(is_right ? -0.54 * fx : 0.0));
    CHECK(p.at(0) == Approx(fx));
  }
  const DatasetInfo dataset = test::sample_dataset(sample);
  std::swap(capture.frames[0].world_from_camera, capture.frames[1].world_from_camera);
  CHECK_THROWS_WITH(test::write_dataset(writer, dataset, {&capture}),
                    ContainsSubstring("does not stand to the right of and parallel to"));
  std::swap(capture.frames[0].world_from_camera, capture.frames[1].world_from_camera);
  capture.frames[1].camera.cx += 1.0;
  CHECK_THROWS_WITH(
      test::write_dataset(writer, dataset, {&capture}),
      ContainsSubstring("has another lens or size than") &&
          ContainsSubstring("expected equal pinhole cameras by twos, left before right"));
  DatasetInfo odd = dataset;
  odd.camera_names.pop_back();
  CHECK_THROWS_WITH(test::write_dataset(writer, odd, {&capture}),
                    ContainsSubstring("by twos, left before right; the job has 1"));
}

TEST_CASE("an upright object keeps its own size, place and heading", "[writers]") {
  // A level camera looking along world +x; a box turned by 30 degrees about the vertical.
  Scene scene;
  const NodeId box = scene.create(scene.root(), "box");
  scene.edit(box).labels = {{"class", "delivery van"}};
  scene.edit(box).mesh = std::make_shared<const Mesh>(make_box({0.8, 0.4, 0.3}));
  Transform pose;
  pose.translation = {4.0, -0.5, 1.2};
  pose.rotation = Quat(Eigen::AngleAxisd(kPi / 6.0, Vec3::UnitZ()));
  scene.set_pose(box, pose);
  const NodeId camera = scene.create(scene.root(), "cam_0");
  scene.edit(camera).camera = Camera::from_lens(64, 40, 24.0, 20.955);
  Transform view;
  view.translation = {0.0, 0.0, 1.5};
  view.rotation = look_rotation(Vec3::UnitX());
  scene.set_pose(camera, view);
  Capture capture;
  capture.frames.push_back(test::ray_cast(scene, camera));

  test::FakeHost host;
  KittiWriter writer({}, host);
  DatasetInfo dataset;
  dataset.capture_count = 1;
  dataset.camera_names = {"cam_0"};
  dataset.labels = {{{"class", "delivery van"}}};
  const MemoryFiles files = test::write_dataset(writer, dataset, {&capture});
  const auto lines = lines_of(files.text("training/label_2/000000.txt"));
  REQUIRE(lines.size() == 1);
  CHECK(lines[0].type == "delivery_van");
  const auto& v = lines[0].values;
  REQUIRE(v.size() == 14);
  CHECK(v[1] == 0);
  CHECK(v[7] == Approx(0.3).margin(1e-3));          // height
  CHECK(v[8] == Approx(0.4).margin(1e-3));          // width
  CHECK(v[9] == Approx(0.8).margin(1e-3));          // length
  CHECK(v[10] == Approx(0.5).margin(1e-3));         // right of the camera: world -y
  CHECK(v[11] == Approx(0.3 + 0.15).margin(1e-3));  // bottom face below the camera
  CHECK(v[12] == Approx(4.0).margin(1e-3));
  // The heading points 30 degrees left of the viewing direction (+z); rotation_y 0 is +x and grows
  // towards -z.
  CHECK(v[13] == Approx(-kPi / 2.0 - kPi / 6.0).margin(1e-3));
  CHECK(v[2] == Approx(v[13] - std::atan2(0.5, 4.0) + (v[2] > 0 ? 2.0 * kPi : 0.0)).margin(0.01));
  const PixelBox& pixels = *capture.frames[0].instances[0].tight_box;
  CHECK(v[3] == pixels.x_min);
  CHECK(v[6] == pixels.y_max);
}

TEST_CASE("depth is metres times 256, zero where nothing is", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<KittiWriter>({}, host);
  const test::RawImage picture = test::raw_image(files.bytes("training/depth_2/000003.png"));
  const auto& depth = test::sample_captures()[1].frames[1].get(kDistanceToImagePlane);
  bool saw_nothing = false;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (std::isinf(depth.at(x, y))) {
        saw_nothing = true;
        CHECK(picture.at(x, y, 0) == 0);
      } else {
        CHECK(std::abs(picture.at(x, y, 0) / 256.0 - depth.at(x, y)) <= 0.5 / 256.0 + 1e-6);
      }
    }
  }
  CHECK(saw_nothing);
}

TEST_CASE("Replicator's thresholds count, what stands for its folders is named", "[writers]") {
  test::FakeHost host;
  const auto labels = [&](const KittiWriter::Params& params) {
    return lines_of(
        test::write_sample<KittiWriter>(params, host).text("training/label_2/000000.txt"));
  };
  const auto all = labels({});
  REQUIRE(all.size() >= 3);
  CHECK(host.messages.empty());
  double highest = 0.0;
  for (const auto& line : all) highest = std::max(highest, line.values[6] - line.values[4]);
  KittiWriter::Params params;
  params.bbox_height_threshold = int(highest);
  CHECK(labels(params).size() < all.size());
  CHECK_FALSE(labels(params).empty());
  params = {};
  params.fully_visible_threshold = 0.0;
  for (const auto& line : labels(params)) CHECK(line.values[1] == 0);
  params = {};
  params.labels.semantic_filter_predicate = "class: mug | ball";
  CHECK(labels(params).size() == 2);
  CHECK(host.messages.empty());
  params = {};
  params.use_kitti_dir_names = false;
  params.mapping_path = "colors.json";
  labels(params);
  CHECK(host.messages ==
        std::vector<std::string>{
            "KittiWriter: use_kitti_dir_names: false has no effect: folders have the benchmark's "
            "names",
            "KittiWriter: there are no segmentation pictures whose colours could be chosen"});
}

TEST_CASE("calibration has its standard lines first and a fisheye's central focal length",
          "[writers]") {
  test::SampleScene sample(24, 16, 1);
  Camera& camera = *sample.scene.edit(sample.cameras[0]).camera;
  camera.lens = LensModel::FisheyePolynomial;
  camera.fisheye_polynomial = {0.0, 0.05, 0.0, 1e-5, 0.0, 0.0};
  camera.fisheye_max_angle_rad = 1.5;
  camera.fx = camera.fy = 999.0;  // of no meaning to this lens
  const Capture capture = test::ray_cast_capture(sample, 0);
  test::FakeHost host;
  KittiWriter writer({}, host);
  const MemoryFiles files = test::write_dataset(writer, test::sample_dataset(sample), {&capture});
  std::istringstream text(files.text("training/calib/000000.txt"));
  std::vector<std::string> keys;
  for (std::string row; std::getline(text, row);) {
    keys.push_back(row.substr(0, row.find(':')));
    if (keys.back() != "P2") continue;
    // A pixel beside the centre is seen at 0.05 rad.
    CHECK(std::stod(row.substr(4)) == Approx(20.0));
  }
  CHECK(keys == std::vector<std::string>{"P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam",
                                         "Tr_imu_to_velo", "lens_2"});
}
