// SPDX-License-Identifier: Apache-2.0
// Rebuilds frames from files that the reference wrote and compares every field of ours with them.
#include <fstream>
#include <optional>

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/memory_files.h"
#include "support/catch.h"
#include "support/shared_data.h"
#include "writer_pose/pose_writer.h"
#include "writer_support/python_json.h"

using namespace diorama;

namespace {

std::optional<Json> golden_json(const std::string& lens, const std::string& camera) {
  const auto shared = test::shared_folder();
  if (!shared) {
    WARN("shared data is absent: golden poses not compared");
    return std::nullopt;
  }
  std::ifstream in(*shared / "data/replicator_golden" / ("pose_writer_" + lens) / camera /
                   "000000.json");
  REQUIRE(in);
  return Json::parse(in);
}

template <class Matrix>
Matrix matrix_of(const Json& rows) {
  Matrix matrix;
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) {
      matrix(r, c) = rows.at(std::size_t(r)).at(std::size_t(c)).template get<double>();
    }
  }
  return matrix;
}

Vec3 vec3_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

/// The file's matrices are rounded to five decimals; this one is a rotation again.
Affine camera_pose(const Json& view_rows) {
  Affine camera_from_world = Affine::Identity();
  camera_from_world.matrix() = matrix_of<Mat4>(view_rows).transpose();
  const Quat rotation(camera_from_world.linear());
  camera_from_world.linear() = rotation.normalized().toRotationMatrix();
  return camera_from_world.inverse();
}

Instance instance_of(const Json& object) {
  Instance instance;
  instance.node_path = object.at("prim_path");
  instance.labels = {{"class", object.at("label")}};
  instance.world_from_node.matrix() =
      matrix_of<Mat4>(object.at("local_to_world_transform")).transpose();
  const Affine node_from_world = instance.world_from_node.inverse();
  for (const Json& point : object.at("cuboid_keypoints_world_frame")) {
    instance.bounds_node.add(node_from_world * vec3_of(point));
  }
  Visibility visibility;
  visibility.amodal_pixels = 1000;
  visibility.visible_pixels = std::lround(1000.0 * object.at("visibility").get<double>());
  instance.visibility = visibility;
  return instance;
}

Capture capture_of(const Json& golden, LensModel lens) {
  const Json& data = golden.at("camera_data");
  Frame frame;
  frame.camera_name = "rp";
  frame.camera = Camera::from_lens(data.at("resolution").at(0), data.at("resolution").at(1),
                                   data.at("focal_length"), data.at("aperture").at(0));
  frame.camera.lens = lens;
  // The file does not say it; it is the default of the reference's fisheye cameras.
  frame.camera.fisheye_polynomial = {0.0, 0.00245, 0.0, 0.0, 0.0, 0.0};
  frame.world_from_camera = camera_pose(data.at("camera_view_matrix"));
  frame.set(kColor, Image<Rgba8>(frame.camera.width, frame.camera.height, Rgba8{}));
  for (const Json& object : golden.at("objects")) frame.instances.push_back(instance_of(object));
  Capture capture;
  capture.frames.push_back(std::move(frame));
  return capture;
}

Json written_json(const Capture& capture, const std::string& compat,
                  const std::string& format = "none") {
  test::FakeHost host;
  PoseWriter::Params params;
  params.compat = compat;
  params.format = format;
  PoseWriter writer(params, host);
  DatasetInfo dataset;
  dataset.camera_names = {"rp"};
  dataset.capture_count = 1;
  return Json::parse(test::write_dataset(writer, dataset, {&capture}).text("000000.json"));
}

/// Numbers within the rounding of the file's matrices; everything else equal.
void compare(const Json& actual, const Json& expected, const std::string& where) {
  INFO(where);
  REQUIRE(actual.is_number_float() == expected.is_number_float());
  if (expected.is_number_float()) {
    CHECK(actual.get<double>() == Approx(expected.get<double>()).margin(1e-3));
  } else if (expected.is_structured()) {
    REQUIRE(actual.size() == expected.size());
    auto theirs = expected.begin();
    for (auto ours = actual.begin(); ours != actual.end(); ++ours, ++theirs) {
      if (expected.is_object()) CHECK(ours.key() == theirs.key());
      compare(*ours, *theirs, where + (expected.is_object() ? "." + theirs.key() : "[]"));
    }
  } else {
    CHECK(actual == expected);
  }
}

/// Quaternions q and -q are the same rotation.
void compare_quaternion(const Json& actual, const Json& expected) {
  double dot = 0.0;
  for (std::size_t i = 0; i < 4; ++i) dot += double(actual.at(i)) * double(expected.at(i));
  CHECK(std::abs(dot) == Approx(1.0).margin(1e-4));
}

}  // namespace

TEST_CASE("compat: replicator repeats the reference's files", "[writers][golden]") {
  const auto [name, lens] = GENERATE(table<std::string, LensModel>(
      {{"pinhole", LensModel::Pinhole}, {"fisheyePolynomial", LensModel::FisheyePolynomial}}));
  for (const std::string camera : {"rp1", "rp2"}) {
    const auto golden = golden_json(name, camera);
    if (!golden) return;
    Json expected = *golden;
    Json actual = written_json(capture_of(expected, lens), "replicator");
    // Not carried by our cameras, which have square pixels: the vertical aperture.
    actual["camera_data"]["aperture"][1] = expected["camera_data"]["aperture"][1];
    // Near and far planes of the reference differ per camera and show in these only.
    actual["camera_data"]["camera_projection_matrix"] =
        expected["camera_data"]["camera_projection_matrix"];
    for (std::size_t i = 0; i < expected["objects"].size(); ++i) {
      for (const char* key : {"quat_wxyz_world_frame", "quat_wxyz_camera_frame"}) {
        compare_quaternion(actual["objects"][i][key], expected["objects"][i][key]);
        actual["objects"][i][key] = expected["objects"][i][key];
      }
    }
    compare(actual, expected, name + " " + camera);
  }
}

TEST_CASE("camera poses are right by default", "[writers][golden]") {
  const auto [name, lens] = GENERATE(table<std::string, LensModel>(
      {{"pinhole", LensModel::Pinhole}, {"fisheyePolynomial", LensModel::FisheyePolynomial}}));
  const auto golden = golden_json(name, "rp1");
  if (!golden) return;
  const Capture capture = capture_of(*golden, lens);
  const Json actual = written_json(capture, "none");
  const Json wrong = written_json(capture, "replicator");
  for (std::size_t i = 0; i < actual["objects"].size(); ++i) {
    const Json& object = actual["objects"][i];
    // The boxes of the file are centred on their origins.
    const Vec3 centre = vec3_of(object["cuboid_keypoints_camera_frame"][0]);
    CHECK((vec3_of(object["location_camera_frame"]) - centre).norm() < 1e-6);
    CHECK(object["cuboid_keypoints_projected"] ==
          (*golden)["objects"][i]["cuboid_keypoints_projected"]);
    // Rotation and location place the local axes where the keypoints lie.
    const Json& wxyz = object["quat_wxyz_camera_frame"];
    const Quat q(wxyz[0].get<double>(), wxyz[1].get<double>(), wxyz[2].get<double>(),
                 wxyz[3].get<double>());
    const Vec3 half = 0.5 * vec3_of(object["size"]);
    const Vec3 ruf = vec3_of(object["cuboid_keypoints_camera_frame"][8]);
    CHECK((centre + q * half - ruf).norm() < 1e-5);
  }
  CHECK((vec3_of(wrong["objects"][2]["location_camera_frame"]) -
         vec3_of(wrong["objects"][2]["cuboid_keypoints_camera_frame"][0]))
            .norm() > 1.0);
}

TEST_CASE("dope and centerpose name and order their fields as the reference", "[writers]") {
  const auto golden = golden_json("pinhole", "rp2");
  if (!golden) return;
  const Capture capture = capture_of(*golden, LensModel::Pinhole);
  const auto keys_of = [](const Json& object) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : object.items()) keys.push_back(key);
    return keys;
  };
  const Json dope = written_json(capture, "none", "DOPE");
  CHECK(keys_of(dope["camera_data"]) ==
        std::vector<std::string>{"intrinsics", "camera_view_matrix", "camera_projection_matrix"});
  CHECK(dope["keypoint_order"].dump() ==
        R"(["LUF","RUF","RDF","LDF","LUB","RUB","RDB","LDB","Center"])");
  CHECK(keys_of(dope["objects"][0]) ==
        std::vector<std::string>{"class", "prim_path", "visibility", "location", "quaternion_xyzw",
                                 "projected_cuboid", "truncation_ratio"});
  const Json centre_pose = written_json(capture, "none", "centerpose");
  CHECK(keys_of(centre_pose["camera_data"]).back() == "height");
  CHECK(keys_of(centre_pose["objects"][0]) ==
        std::vector<std::string>{"label", "prim_path", "visibility", "location", "quaternion_xyzw",
                                 "scale", "keypoints_3d", "projected_cuboid", "truncation_ratio"});
  // The same corner under both orders: LUF is first in dope, fifth in the other.
  CHECK(dope["objects"][1]["projected_cuboid"][0] ==
        centre_pose["objects"][1]["projected_cuboid"][4]);
}
