// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/basic_writer.h"

#include <algorithm>
#include <cstring>
#include <set>

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/memory_files.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"
#include "writer_support/python_json.h"
#include "writer_support/segmentation_colors.h"

using namespace diorama;
using test::FakeHost;
using test::MemoryFiles;
using test::RawImage;
using test::SampleScene;

namespace {

BasicWriter::Params everything() {
  BasicWriter::Params params;
  for (bool* wanted :
       {&params.rgb, &params.bounding_box_2d_tight, &params.bounding_box_2d_loose,
        &params.semantic_segmentation, &params.instance_id_segmentation,
        &params.instance_segmentation, &params.distance_to_camera, &params.distance_to_image_plane,
        &params.bounding_box_3d, &params.occlusion, &params.normals, &params.motion_vectors,
        &params.camera_params, &params.pointcloud, &params.skeleton_data}) {
    *wanted = true;
  }
  return params;
}

MemoryFiles write(const BasicWriter::Params& params, const Capture& capture,
                  DatasetInfo dataset = test::sample_dataset(SampleScene(8, 6))) {
  FakeHost host;
  BasicWriter writer(params, host);
  return test::write_dataset(writer, dataset, {&capture});
}

/// The sample seen by the first or by both cameras, rendered once.
const Capture& capture_of(int cameras) {
  static const Capture one = test::ray_cast_capture(SampleScene(96, 64, 1), 0);
  static const Capture two = test::ray_cast_capture(SampleScene(96, 64, 2), 0);
  return cameras == 1 ? one : two;
}

const Instance& instance_at(const Frame& frame, const std::string& path) {
  const auto found = std::ranges::find(frame.instances, path, &Instance::node_path);
  REQUIRE(found != frame.instances.end());
  return *found;
}

template <class T>
T value_at(const std::vector<std::byte>& bytes, std::size_t offset) {
  T value{};
  REQUIRE(offset + sizeof value <= bytes.size());
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::string color_at(const RawImage& image, int x, int y) {
  return color_text({std::uint8_t(image.at(x, y, 0)), std::uint8_t(image.at(x, y, 1)),
                     std::uint8_t(image.at(x, y, 2)), std::uint8_t(image.at(x, y, 3))});
}

}  // namespace

TEST_CASE("one camera's files lie flat", "[writers]") {
  const std::set<std::string> expected{"metadata.txt",
                                       "rgb_0000.png",
                                       "normals_0000.png",
                                       "distance_to_camera_0000.npy",
                                       "distance_to_image_plane_0000.npy",
                                       "semantic_segmentation_0000.png",
                                       "semantic_segmentation_labels_0000.json",
                                       "instance_id_segmentation_0000.png",
                                       "instance_id_segmentation_mapping_0000.json",
                                       "instance_segmentation_0000.png",
                                       "instance_segmentation_mapping_0000.json",
                                       "instance_segmentation_semantics_mapping_0000.json",
                                       "bounding_box_2d_tight_0000.npy",
                                       "bounding_box_2d_tight_labels_0000.json",
                                       "bounding_box_2d_tight_prim_paths_0000.json",
                                       "bounding_box_2d_loose_0000.npy",
                                       "bounding_box_2d_loose_labels_0000.json",
                                       "bounding_box_2d_loose_prim_paths_0000.json",
                                       "bounding_box_3d_0000.npy",
                                       "bounding_box_3d_labels_0000.json",
                                       "bounding_box_3d_prim_paths_0000.json",
                                       "motion_vectors_0000.npy",
                                       "occlusion_0000.npy",
                                       "camera_params_0000.json",
                                       "pointcloud_0000.npy",
                                       "pointcloud_rgb_0000.npy",
                                       "pointcloud_normals_0000.npy",
                                       "pointcloud_semantic_0000.npy",
                                       "pointcloud_instance_0000.npy"};
  CHECK(write(everything(), capture_of(1)).paths() == expected);
}

TEST_CASE("several cameras get folders of their own, or share one per annotator", "[writers]") {
  BasicWriter::Params params;
  params.rgb = params.semantic_segmentation = params.distance_to_camera = true;
  params.colorize_depth = true;
  CHECK(write(params, capture_of(2)).paths() ==
        std::set<std::string>{
            "metadata.txt", "rp_cam_0/rgb/rgb_0000.png", "rp_cam_1/rgb/rgb_0000.png",
            "rp_cam_0/semantic_segmentation/semantic_segmentation_0000.png",
            "rp_cam_0/semantic_segmentation/semantic_segmentation_labels_0000.json",
            "rp_cam_1/semantic_segmentation/semantic_segmentation_0000.png",
            "rp_cam_1/semantic_segmentation/semantic_segmentation_labels_0000.json",
            "rp_cam_0/distance_to_camera/distance_to_camera_0000.npy",
            "rp_cam_0/distance_to_camera/distance_to_camera_0000.png",
            "rp_cam_1/distance_to_camera/distance_to_camera_0000.npy",
            "rp_cam_1/distance_to_camera/distance_to_camera_0000.png"});
  params.use_common_output_dir = true;
  params.distance_to_camera = false;
  params.image_output_format = "jpeg";
  CHECK(write(params, capture_of(2)).paths() ==
        std::set<std::string>{
            "metadata.txt", "rgb/rp_cam_0_rgb_0000.jpeg", "rgb/rp_cam_1_rgb_0000.jpeg",
            "semantic_segmentation/rp_cam_0_semantic_segmentation_0000.png",
            "semantic_segmentation/rp_cam_0_semantic_segmentation_labels_0000.json",
            "semantic_segmentation/rp_cam_1_semantic_segmentation_0000.png",
            "semantic_segmentation/rp_cam_1_semantic_segmentation_labels_0000.json"});
}

TEST_CASE("metadata.txt has the reference's text", "[writers]") {
  CHECK(write({}, capture_of(1)).text("metadata.txt") ==
        R"({"name": "BasicWriter", "version": "0.0.2", "replicator_global_seed:": 12})");
}

TEST_CASE("frame numbers come from the capture and grow with the plan", "[writers]") {
  BasicWriter::Params params;
  params.rgb = true;
  Capture capture = test::ray_cast_capture(SampleScene(8, 6, 1), 0);
  capture.index = 1234;
  DatasetInfo dataset = test::sample_dataset(SampleScene(8, 6, 1));
  dataset.capture_count = 10000;
  CHECK(write(params, capture, dataset).paths().contains("rgb_1234.png"));
  dataset.capture_count = 10001;
  CHECK(write(params, capture, dataset).paths().contains("rgb_01234.png"));
}

TEST_CASE("a scene without labels has no labelled files", "[writers]") {
  BasicWriter::Params params = everything();
  params.semantic_filter_predicate = "colour:*";
  for (const std::string& path : write(params, capture_of(1)).paths()) {
    CHECK(path.find("bounding_box") == std::string::npos);
    CHECK(path.find("semantic_segmentation") == std::string::npos);
    CHECK(path.find("instance_segmentation") == std::string::npos);
    CHECK(path.find("occlusion") == std::string::npos);
  }
}

TEST_CASE("semantic pictures and their labels agree with the instances", "[writers]") {
  const Capture& capture = capture_of(1);
  const Frame& frame = capture.frames[0];
  const MemoryFiles files = write(everything(), capture);
  const RawImage picture = test::raw_image(files.bytes("semantic_segmentation_0000.png"));
  const Json labels = Json::parse(files.text("semantic_segmentation_labels_0000.json"));
  CHECK(labels.at("(0, 0, 0, 0)").dump() == R"({"class":"BACKGROUND"})");
  CHECK(labels.at("(0, 0, 0, 255)").dump() == R"({"class":"UNLABELLED"})");
  CHECK(labels.size() == 5);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const std::uint32_t id = frame.get(kInstanceId).at(x, y);
      std::string expected = frame.get(kLeafId).at(x, y) == 0 ? "BACKGROUND" : "UNLABELLED";
      for (const Instance& instance : frame.instances) {
        if (id != 0 && instance.id == id) expected = instance.labels.at("class");
      }
      CHECK(labels.at(color_at(picture, x, y)).at("class") == expected);
    }
  }
}

TEST_CASE("labels of the golden file have the golden file's colours", "[writers][golden]") {
  // Ids 2, 3 and 4 are what the dataset's three label sets get in sorted order.
  Scene scene;
  std::vector<std::uint32_t> leaves{0};
  for (const char* label : {"a_crate", "b_large_marker", "c_banana"}) {
    const NodeId node = scene.create(scene.root(), label);
    scene.edit(node).labels = {{"class", label}};
    scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(Vec3::Ones()));
    leaves.push_back(node.index);
  }
  Capture capture;
  Frame frame;
  frame.camera.width = 4;
  frame.camera.height = 1;
  Image<std::uint32_t> ids(4, 1, 0);
  std::ranges::copy(leaves, ids.pixels().begin());
  frame.set(kLeafId, ids);
  frame.set(kInstanceId, ids);
  for (std::size_t i = 1; i < 4; ++i) {
    Instance instance;
    instance.id = leaves[i];
    instance.labels = scene[NodeId{leaves[i]}].labels;
    frame.instances.push_back(instance);
  }
  capture.frames.push_back(std::move(frame));
  BasicWriter::Params params;
  params.semantic_segmentation = true;
  DatasetInfo dataset;
  CHECK(write(params, capture, dataset).text("semantic_segmentation_labels_0000.json") ==
        R"x({"(0, 0, 0, 0)": {"class": "BACKGROUND"}, "(0, 0, 0, 255)": )x"
        R"x({"class": "UNLABELLED"}, "(93, 220, 11, 255)": {"class": "a_crate"}, )x"
        R"x("(243, 69, 141, 255)": {"class": "b_large_marker"}, )x"
        R"x("(35, 198, 233, 255)": {"class": "c_banana"}})x");
}

TEST_CASE("raw ids are 16-bit pictures with ids as keys", "[writers]") {
  BasicWriter::Params params = everything();
  params.colorize_semantic_segmentation = false;
  params.colorize_instance_segmentation = false;
  params.colorize_instance_id_segmentation = false;
  const Capture& capture = capture_of(1);
  const Frame& frame = capture.frames[0];
  const MemoryFiles files = write(params, capture);
  const RawImage semantic = test::raw_image(files.bytes("semantic_segmentation_0000.png"));
  CHECK(semantic.channels == 1);
  CHECK(semantic.bits_per_channel == 16);
  const Json labels = Json::parse(files.text("semantic_segmentation_labels_0000.json"));
  CHECK(labels.at("2").at("class") == "ball");
  CHECK(labels.at("3").at("class") == "crate");
  CHECK(labels.at("4").at("class") == "mug");

  const RawImage leaves = test::raw_image(files.bytes("instance_id_segmentation_0000.png"));
  const Json paths = Json::parse(files.text("instance_id_segmentation_mapping_0000.json"));
  CHECK(paths.at("0") == "INVALID");
  const RawImage instances = test::raw_image(files.bytes("instance_segmentation_0000.png"));
  const Json nodes = Json::parse(files.text("instance_segmentation_mapping_0000.json"));
  const Json classes = Json::parse(files.text("instance_segmentation_semantics_mapping_0000.json"));
  bool saw_mug_body = false;
  for (int y = 0; y < leaves.height; ++y) {
    for (int x = 0; x < leaves.width; ++x) {
      const std::uint32_t leaf = frame.get(kLeafId).at(x, y);
      const std::string leaf_path = paths.at(std::to_string(leaves.at(x, y, 0)));
      CHECK(leaf_path == (leaf == 0 ? "INVALID" : frame.leaf_paths.at(leaf)));
      const std::string key = std::to_string(instances.at(x, y, 0));
      if (leaf_path == "/Assets/mug/body") {
        saw_mug_body = true;
        CHECK(nodes.at(key) == "/Assets/mug");
        CHECK(classes.at(key).at("class") == "mug");
      }
      if (leaf_path == "/Distractors/cone") CHECK(nodes.at(key) == "UNLABELLED");
    }
  }
  CHECK(saw_mug_body);
}

TEST_CASE("2-D boxes name the last pixel, the hidden share and their rows", "[writers]") {
  const Capture& capture = capture_of(1);
  const Frame& frame = capture.frames[0];
  const MemoryFiles files = write(everything(), capture);
  for (const std::string kind : {"tight", "loose"}) {
    const std::string stem = "bounding_box_2d_" + kind;
    const auto& array = files.bytes(stem + "_0000.npy");
    const Json labels = Json::parse(files.text(stem + "_labels_0000.json"));
    const Json paths = Json::parse(files.text(stem + "_prim_paths_0000.json"));
    REQUIRE(array.size() == 256 + 24 * paths.size());
    // The hidden box has no visible pixel, but its whole extent lies in the image.
    CHECK(paths.size() == (kind == "tight" ? 3 : 4));
    for (std::size_t row = 0; row < paths.size(); ++row) {
      const std::size_t at = 256 + 24 * row;
      const Instance& instance = instance_at(frame, paths[row]);
      const PixelBox box = kind == "tight" ? *instance.tight_box : *instance.visibility->amodal_box;
      CHECK(labels.at(std::to_string(value_at<std::uint32_t>(array, at))).at("class") ==
            instance.labels.at("class"));
      CHECK(value_at<std::int32_t>(array, at + 4) == box.x_min);
      CHECK(value_at<std::int32_t>(array, at + 8) == box.y_min);
      CHECK(value_at<std::int32_t>(array, at + 12) == box.x_max - 1);
      CHECK(value_at<std::int32_t>(array, at + 16) == box.y_max - 1);
      CHECK(value_at<float>(array, at + 20) ==
            Approx(instance.visibility->occlusion().value()).margin(1e-6));
    }
  }
}

TEST_CASE("3-D boxes hold node-space extents and row-vector poses", "[writers]") {
  const Capture& capture = capture_of(1);
  const Frame& frame = capture.frames[0];
  const MemoryFiles files = write(everything(), capture);
  const auto& array = files.bytes("bounding_box_3d_0000.npy");
  const Json paths = Json::parse(files.text("bounding_box_3d_prim_paths_0000.json"));
  REQUIRE(array.size() == 320 + 96 * paths.size());
  REQUIRE(paths[0] == "/Assets/crate");
  CHECK(value_at<float>(array, 320 + 4) == Approx(-0.2));
  CHECK(value_at<float>(array, 320 + 24) == Approx(0.1));
  const Affine& pose = instance_at(frame, "/Assets/crate").world_from_node;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      CHECK(value_at<float>(array, 320 + 28 + std::size_t(16 * r + 4 * c)) ==
            Approx(pose.matrix()(c, r)).margin(1e-6));
    }
  }
}

TEST_CASE("an empty selection keeps shape and type of the box files", "[writers]") {
  // Labelled, but nothing in sight.
  Scene scene;
  const NodeId box = scene.create(scene.root(), "box");
  scene.edit(box).labels = {{"class", "box"}};
  scene.edit(box).mesh = std::make_shared<const Mesh>(make_box(Vec3::Ones()));
  const NodeId camera = scene.create(scene.root(), "cam_0");
  scene.edit(camera).camera = Camera::from_lens(12, 8, 24.0, 20.955);
  scene.set_pose(camera, Transform{{0.0, 0.0, -5.0}, Quat::Identity(), Vec3::Ones()});
  Capture capture;
  capture.frames.push_back(test::ray_cast(scene, camera));
  const MemoryFiles files = write(everything(), capture);
  CHECK(files.bytes("bounding_box_2d_tight_0000.npy").size() == 256);
  CHECK(files.text("bounding_box_2d_tight_0000.npy").find("'shape': (0,)") != std::string::npos);
  CHECK(files.bytes("bounding_box_3d_0000.npy").size() == 320);
  CHECK(files.bytes("occlusion_0000.npy").size() == 192);
  CHECK(files.text("bounding_box_3d_labels_0000.json") == "{}");
  CHECK(files.text("bounding_box_3d_prim_paths_0000.json") == "[]");
}

TEST_CASE("depth is exact, infinite where nothing is, and coloured by its logarithm", "[writers]") {
  Frame frame;
  frame.camera_name = "cam_0";
  frame.camera.width = 4;
  frame.camera.height = 1;
  Image<float> depth(4, 1, std::numeric_limits<float>::infinity());
  depth.at(0, 0) = 0.5f;
  depth.at(1, 0) = 1.0f;
  depth.at(2, 0) = 2.0f;
  frame.set(kDistanceToCamera, std::move(depth));
  Capture capture;
  capture.frames.push_back(std::move(frame));
  BasicWriter::Params params;
  params.distance_to_camera = params.colorize_depth = true;
  const MemoryFiles files = write(params, capture);
  const auto& array = files.bytes("distance_to_camera_0000.npy");
  REQUIRE(array.size() == 128 + 16);
  CHECK(value_at<float>(array, 132) == 1.0f);
  CHECK(std::isinf(value_at<float>(array, 140)));
  const RawImage gray = test::raw_image(files.bytes("distance_to_camera_0000.png"));
  CHECK(gray.at(0, 0, 0) == 254);
  CHECK(gray.at(1, 0, 0) == 127);
  CHECK(gray.at(2, 0, 0) == 0);
  CHECK(gray.at(3, 0, 0) == 0);
}

TEST_CASE("normals and motion are written in the reference's terms", "[writers]") {
  Frame frame;
  frame.camera_name = "cam_0";
  frame.camera.width = 2;
  frame.camera.height = 1;
  Image<Vec3f> normals(2, 1, Vec3f::Zero());
  normals.at(0, 0) = Vec3f(0.6f, -0.8f, 0.0f);
  frame.set(kNormals, std::move(normals));
  Image<Vec2f> motion(2, 1, Vec2f::Zero());
  motion.at(0, 0) = Vec2f(3.0f, -2.0f);
  frame.set(kMotion, std::move(motion));
  Capture capture;
  capture.frames.push_back(std::move(frame));
  BasicWriter::Params params;
  params.normals = params.motion_vectors = true;
  const MemoryFiles files = write(params, capture);
  const RawImage picture = test::raw_image(files.bytes("normals_0000.png"));
  CHECK(color_at(picture, 0, 0) == "(204, 25, 127, 255)");
  CHECK(color_at(picture, 1, 0) == "(127, 127, 127, 127)");
  const auto& array = files.bytes("motion_vectors_0000.npy");
  CHECK(value_at<float>(array, 128) == -3.0f);  // to the right is negative
  CHECK(value_at<float>(array, 132) == 2.0f);   // up is positive
}

TEST_CASE("camera parameters project world points onto their pixels", "[writers]") {
  const Capture& capture = capture_of(2);
  const MemoryFiles files = write(everything(), capture);
  for (const Frame& frame : capture.frames) {
    const Json json = Json::parse(
        files.text("rp_" + frame.camera_name + "/camera_params/camera_params_0000.json"));
    std::vector<std::string> keys;
    for (const auto& [key, value] : json.items()) keys.push_back(key);
    CHECK(keys == std::vector<std::string>{
                      "cameraAperture", "cameraApertureOffset", "cameraFisheyeLensP",
                      "cameraFisheyeLensS", "cameraFisheyeMaxFOV", "cameraFisheyeNominalHeight",
                      "cameraFisheyeNominalWidth", "cameraFisheyeOpticalCentre",
                      "cameraFisheyePolynomial", "cameraFocalLength", "cameraFocusDistance",
                      "cameraFStop", "cameraModel", "cameraNearFar", "cameraProjection",
                      "cameraViewTransform", "metersPerSceneUnit", "renderProductResolution"});
    Mat4 view, projection;
    for (int i = 0; i < 16; ++i) {
      view(i / 4, i % 4) = json["cameraViewTransform"][std::size_t(i)];
      projection(i / 4, i % 4) = json["cameraProjection"][std::size_t(i)];
    }
    const auto& positions = frame.get(kPosition);
    int checked = 0;
    for (int i = 0; i < frame.camera.width * frame.camera.height; i += 37) {
      const int x = i % frame.camera.width;
      const int y = i / frame.camera.width;
      if (frame.get(kLeafId).at(x, y) == 0) continue;
      ++checked;
      const Eigen::RowVector4d clip =
          positions.at(x, y).cast<double>().homogeneous().transpose() * view * projection;
      CHECK((clip[0] / clip[3] + 1.0) * 0.5 * frame.camera.width == Approx(x + 0.5).margin(1e-3));
      CHECK((1.0 - clip[1] / clip[3]) * 0.5 * frame.camera.height == Approx(y + 0.5).margin(1e-3));
      CHECK(clip[2] / clip[3] < 1.0);
      CHECK(clip[2] / clip[3] > 0.0);
    }
    CHECK(checked > 20);
  }
}

TEST_CASE("the point cloud holds the labelled pixels in reading order", "[writers]") {
  const Capture& capture = capture_of(1);
  const Frame& frame = capture.frames[0];
  BasicWriter::Params params = everything();
  const auto labelled = write(params, capture).bytes("pointcloud_0000.npy").size() - 128;
  params.pointcloud_include_unlabelled = true;
  const MemoryFiles files = write(params, capture);
  std::size_t labelled_count = 0;
  std::size_t hit_count = 0;
  for (std::size_t i = 0; i < frame.get(kLeafId).pixels().size(); ++i) {
    if (frame.get(kInstanceId).pixels()[i] != 0) ++labelled_count;
    if (frame.get(kLeafId).pixels()[i] == 0) continue;
    const auto& points = files.bytes("pointcloud_0000.npy");
    CHECK(value_at<float>(points, 128 + 12 * hit_count) == frame.get(kPosition).pixels()[i].x());
    CHECK(value_at<std::uint8_t>(files.bytes("pointcloud_rgb_0000.npy"), 128 + 4 * hit_count) ==
          frame.get(kColor).pixels()[i][0]);
    ++hit_count;
  }
  CHECK(labelled == 12 * labelled_count);
  CHECK(files.bytes("pointcloud_0000.npy").size() == 128 + 12 * hit_count);
  CHECK(files.bytes("pointcloud_semantic_0000.npy").size() == 128 + 4 * hit_count);
}

TEST_CASE("only what was asked for is demanded from the renderer", "[writers]") {
  FakeHost host;
  BasicWriter::Params params;
  params.rgb = true;
  CHECK(BasicWriter(params, host).needs() == NameSet{"color", "instances"});
  params.image_output_format = "exr";
  params.bounding_box_2d_loose = true;
  CHECK(BasicWriter(params, host).needs() ==
        NameSet{"color_hdr", "instance_id", "instances", "visibility"});
}

TEST_CASE("S3 output is refused with a message", "[writers]") {
  FakeHost host;
  BasicWriter::Params params;
  params.remote.s3_bucket = "pictures";
  CHECK_THROWS_WITH(BasicWriter(params, host), ContainsSubstring("s3_bucket: found 'pictures'"));
}

TEST_CASE("semantic_types may be null, must be texts, and replaces the class filter", "[writers]") {
  FakeHost host;
  BasicWriter::Params params = everything();
  params.semantic_types = Value::make_list();
  params.semantic_types.list.push_back(Value::text("shape"));
  const Capture& capture = capture_of(1);
  const MemoryFiles files = write(params, capture);
  CHECK(files.text("bounding_box_2d_tight_labels_0000.json") == R"({"0": {"shape": "cuboid"}})");
  params.semantic_types = Value();
  CHECK_NOTHROW(BasicWriter(params, host));
  params.semantic_types = Value::text("class");
  CHECK_THROWS_WITH(BasicWriter(params, host),
                    ContainsSubstring("semantic_types: expected a list of texts or null"));
}

TEST_CASE("channels of other plugins are written as they are", "[writers]") {
  const SampleScene sample(24, 16, 1);
  Capture capture = test::ray_cast_capture(sample, 0);
  Image<float> disparity(24, 16, 0.5f);
  disparity.at(3, 2) = 7.25f;
  capture.frames[0].set(Channel<float>{"disparity"}, disparity);
  capture.frames[0].set(Channel<Vec2f>{"flow"}, Image<Vec2f>(24, 16, Vec2f(1.0f, 2.0f)));
  BasicWriter::Params params;
  params.channels.names = {"disparity", "flow", "leaf_id", "color"};
  const MemoryFiles files = write(params, capture, test::sample_dataset(sample));
  const auto header = [&](const std::string& path) { return files.text(path).substr(10, 118); };
  CHECK(header("disparity_0000.npy").find("'<f4', 'fortran_order': False, 'shape': (16, 24), }") !=
        std::string::npos);
  CHECK(header("flow_0000.npy").find("'<f4', 'fortran_order': False, 'shape': (16, 24, 2), }") !=
        std::string::npos);
  CHECK(header("leaf_id_0000.npy").find("'<u4'") != std::string::npos);
  CHECK(header("color_0000.npy").find("'|u1', 'fortran_order': False, 'shape': (16, 24, 4), }") !=
        std::string::npos);
  CHECK(value_at<float>(files.bytes("disparity_0000.npy"), 128 + 4 * (2 * 24 + 3)) == 7.25f);
  CHECK(value_at<float>(files.bytes("flow_0000.npy"), 128 + 4) == 2.0f);
}

TEST_CASE("a list of channels that cannot be written says why", "[writers]") {
  FakeHost host;
  const auto complaint = [&](std::vector<std::string> names, const std::string& what) {
    BasicWriter::Params params;
    params.distance_to_camera = true;
    params.channels.names = std::move(names);
    CHECK_THROWS_WITH(BasicWriter(params, host), ContainsSubstring(what));
  };
  complaint({"../up"}, "channels: '../up' is no name of a channel");
  complaint({""}, "channels: '' is no name of a channel");
  complaint({"visibility"}, "channels: 'visibility' is an annotation, not a channel");
  complaint({"a", "a"}, "channels: 'a' is listed twice");
  complaint({"distance_to_camera"}, "is the name of something that this writer makes");
  BasicWriter::Params params;
  params.channels.names = {"disparity"};
  CHECK(BasicWriter(params, host).needs().contains("disparity"));
}
