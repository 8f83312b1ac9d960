// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_writer.h"

#include <cmath>
#include <cstring>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_bop/model_symmetries.h"
#include "writer_bop/point_diameter.h"

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
        // Scale is part of the model: readers know R and t only. Ours finds it beside them.
        const Vec3 local = instance.bounds_node.corner(3);
        const Vec3 scale = Transform::from_affine(instance.world_from_node).scale;
        const bool is_scaled = (scale - Vec3::Ones()).norm() > 1e-6;
        REQUIRE(pose.contains("scale") == is_scaled);
        for (int i = 0; is_scaled && i < 3; ++i) {
          CHECK(pose.at("scale")[std::size_t(i)].get<double>() == Approx(scale[i]));
        }
        Mat3 rotation;
        Vec3 translation;
        for (int i = 0; i < 9; ++i) {
          rotation(i / 3, i % 3) = pose.at("cam_R_m2c")[std::size_t(i)].get<double>();
        }
        for (int i = 0; i < 3; ++i) {
          translation[i] = pose.at("cam_t_m2c")[std::size_t(i)].get<double>();
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
  const Frame& frame = test::sample_captures()[0].frames[0];
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
    const Visibility& seen =
        *test::instance_at(frame, poses[i].at("node").get<std::string>()).visibility;
    CHECK(whole_count == seen.amodal_pixels);
  }
}

/// What the toolkit does: the object alone in a picture of three times the size, whose middle is
/// the picture; boxes from the first pixel to the last one.
TEST_CASE("counts and boxes are those of the whole silhouette", "[writers]") {
  const MemoryFiles files = write();
  const Json infos = Json::parse(files.text(scene_of(files, 0, 0) + "/scene_gt_info.json")).at("0");
  const Json poses = Json::parse(files.text(scene_of(files, 0, 0) + "/scene_gt.json")).at("0");
  int cut_off = 0;
  for (std::size_t i = 0; i < infos.size(); ++i) {
    test::SampleScene alone(72, 48, 2);
    const std::string node = poses[i].at("node");
    for (const char* other : {"/Assets/crate", "/Assets/mug", "/Assets/ball", "/Assets/hidden"}) {
      if (node != other) alone.scene.edit(alone.scene.require(other)).is_visible = false;
    }
    alone.scene.edit(alone.scene.require("/Environment")).is_visible = false;
    alone.scene.edit(alone.scene.require("/Distractors")).is_visible = false;
    Camera& camera = *alone.scene.edit(alone.cameras[0]).camera;
    camera.cx += camera.width;
    camera.cy += camera.height;
    camera.width *= 3;
    camera.height *= 3;
    const Frame large = test::ray_cast(alone.scene, alone.cameras[0]);
    const Instance& object = test::instance_at(large, node);
    const PixelBox& box = object.tight_box.value();
    const std::int64_t all = test::visible_count(large, object);
    const Json& info = infos[i];
    CAPTURE(node);
    CHECK(info.at("px_count_all") == all);
    CHECK(info.at("visib_fract").get<double>() ==
          Approx(info.at("px_count_visib").get<double>() / double(all)));
    CHECK(info.at("bbox_obj") ==
          Json({box.x_min - 72, box.y_min - 48, box.width() - 1, box.height() - 1}));
    if (box.x_min < 72 || box.y_min < 48 || box.x_max > 144 || box.y_max > 96) {
      ++cut_off;
      CHECK(info.at("visib_fract") < 1.0);
    }
  }
  CHECK(cut_off > 0);
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

namespace {

/// Positions of a model's vertices.
std::vector<Vec3f> vertices_of(const MemoryFiles& files, const std::string& path) {
  const std::string ply = files.text(path);
  const std::string end = "end_header\n";
  const std::size_t data = ply.find(end) + end.size();
  std::vector<Vec3f> points(std::stoul(ply.substr(ply.find("element vertex ") + 15)));
  for (std::size_t i = 0; i < points.size(); ++i)
    std::memcpy(points[i].data(), &ply[data + 27 * i], 12);
  return points;
}

/// The sample's captures with the mug in other sizes.
std::vector<Capture> with_sizes(const std::vector<Vec3>& scales) {
  std::vector<Capture> captures;
  for (int i = 0; i < int(scales.size()); ++i) {
    test::SampleScene sample(72, 48, 1);
    const NodeId mug = sample.scene.require("/Assets/mug");
    Affine pose = sample.scene[mug].parent_from_node;
    pose.linear() *= scales[std::size_t(i)].asDiagonal();
    sample.scene.set_pose(mug, pose);
    captures.push_back(test::ray_cast_capture(sample, i));
  }
  return captures;
}

MemoryFiles write_sizes(BopWriter::Params params, const std::vector<Capture>& captures) {
  test::FakeHost host;
  BopWriter writer(std::move(params), host);
  std::vector<const Capture*> pointers;
  for (const Capture& capture : captures) pointers.push_back(&capture);
  return test::write_dataset(writer, test::sample_dataset(test::SampleScene(8, 6, 1)), pointers);
}

}  // namespace

TEST_CASE("objects of other sizes get models of their size", "[writers]") {
  const std::vector<Vec3> scales{{1.2, 1.2, 1.2}, {0.8, 1.0, 0.9}, {1.2, 1.2, 1.2}};
  const std::vector<Capture> captures = with_sizes(scales);
  const MemoryFiles files = write_sizes({}, captures);
  const Json models = Json::parse(files.text("models/models_info.json"));
  CHECK(Json::parse(files.text("objects.json")) ==
        Json{{"1", "ball"}, {"2", "crate"}, {"3", "mug"}, {"4", "mug"}});
  CHECK(models.at("3").at("scale") == Json({1.2, 1.2, 1.2}));
  CHECK(models.at("4").at("unscaled_as") == 3);
  for (int capture = 0; capture < 3; ++capture) {
    const Frame& frame = captures[std::size_t(capture)].frames[0];
    const Instance& mug = test::instance_at(frame, "/Assets/mug");
    const std::string gt = files.text(scene_of(files, capture, 0) + "/scene_gt.json");
    for (const Json& pose : Json::parse(gt).at(std::to_string(capture))) {
      if (pose.at("node") != "/Assets/mug") continue;
      CHECK(pose.at("obj_id") == (capture == 1 ? 4 : 3));
      // Every vertex comes to where it is in the picture, by R and t alone.
      Mat3 rotation;
      Vec3 translation;
      for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = pose.at("cam_R_m2c")[std::size_t(i)];
      for (int i = 0; i < 3; ++i) translation[i] = pose.at("cam_t_m2c")[std::size_t(i)];
      const std::string id = std::to_string(pose.at("obj_id").get<int>());
      Aabb seen, expected;
      for (const Vec3f& vertex : vertices_of(files, "models/obj_00000" + id + ".ply")) {
        seen.add(rotation * vertex.cast<double>() + translation);
      }
      const Affine camera_from_node = frame.world_from_camera.inverse() * mug.world_from_node;
      test::SampleScene model(8, 6, 1);
      for (const char* part : {"/Assets/mug/body", "/Assets/mug/handle"}) {
        const NodeId node = model.scene.require(part);
        for (const Vec3f& vertex : model.scene[node].mesh->positions) {
          const Vec3 point =
              camera_from_node * (model.scene[node].parent_from_node * vertex.cast<double>());
          expected.add(1000.0 * Vec3(point.x(), -point.y(), -point.z()));
        }
      }
      CHECK((seen.min - expected.min).norm() < 0.01);
      CHECK((seen.max - expected.max).norm() < 0.01);
    }
  }
}

TEST_CASE("too many sizes end the job early and say why", "[writers]") {
  BopWriter::Params params;
  params.max_models = 2;
  CHECK_THROWS_WITH(
      write_sizes(params, with_sizes({{1.0, 1.0, 1.0}, {1.1, 1.0, 1.0}, {1.2, 1.0, 1.0}})),
      ContainsSubstring("max_models: objects come in more than 2 sizes"));
}

TEST_CASE("the diameter is the greatest distance of two vertices", "[writers]") {
  // A cone as high as it is wide: from its rim to its tip.
  const Mesh cone = make_cone(0.1, 0.2, 48);
  CHECK(point_diameter(cone.positions) == Approx(std::hypot(0.1, 0.2)).epsilon(1e-6));
  CHECK(point_diameter({}) == 0.0);
  CHECK(point_diameter(std::vector<Vec3f>(40, Vec3f(1.0f, 2.0f, 3.0f))) == 0.0);
  const std::vector<Mesh> meshes{make_box({0.1, 0.2, 0.3}), make_sphere(0.1, 40),
                                 make_cylinder(0.1, 0.5, 30), make_capsule(0.1, 0.3, 30)};
  for (const Mesh& mesh : meshes) {
    double expected = 0.0;
    for (const Vec3f& a : mesh.positions) {
      for (const Vec3f& b : mesh.positions) {
        expected = std::max(expected, (a.cast<double>() - b.cast<double>()).norm());
      }
    }
    CHECK(point_diameter(mesh.positions) == expected);
  }
}

TEST_CASE("cameras of one scene stand behind the names of its files", "[writers]") {
  test::FakeHost host;
  BopWriter::Params params;
  params.layout = "cameras";
  const MemoryFiles files = test::write_sample<BopWriter>(params, host);
  const MemoryFiles scenes = write();
  for (int capture = 0; capture < 3; ++capture) {
    const std::string split = test::split_of(files, capture) == "val" ? "test/" : "train_pbr/";
    const std::string id = std::to_string(capture);
    for (int camera = 0; camera < 2; ++camera) {
      const std::string end = "_cam_" + std::to_string(camera);
      const std::string own = split + "00000" + std::to_string(camera);
      for (const char* kind : {"rgb", "depth"}) {
        CHECK(files.bytes(split + "000000/" + kind + end + "/00000" + id + ".png") ==
              scenes.bytes(own + "/" + kind + "/00000" + id + ".png"));
      }
      CHECK(
          files.files.contains(split + "000000/mask_visib" + end + "/00000" + id + "_000000.png"));
      for (const char* file : {"scene_camera", "scene_gt", "scene_gt_info"}) {
        CHECK(files.text(split + "000000/" + file + end + ".json") ==
              scenes.text(own + "/" + file + ".json"));
      }
    }
  }
  CHECK(Json::parse(files.text("camera_cam_1.json")).at("width") == 54);
  CHECK(files.text("camera.json") == files.text("camera_cam_0.json"));
  for (const Json& target : Json::parse(files.text("test_targets_bop24.json"))) {
    CHECK(target.at("scene_id") == 0);
    CHECK(test::split_of(files, target.at("im_id")) == "val");
  }
}

TEST_CASE("models and targets name objects by their class numbers", "[writers]") {
  const MemoryFiles files = write();
  const Json models = Json::parse(files.text("models/models_info.json"));
  CHECK(models.at("2").at("size_x").get<double>() == Approx(440.0));  // 0.4 m, 1.1 times
  CHECK(models.at("2").at("min_y").get<double>() == Approx(-135.0));
  CHECK(models.at("2").at("diameter").get<double>() == Approx(578.014).margin(1e-2));
  CHECK(Json::parse(files.text("objects.json")).at("2") == "crate");
  for (const Json& target : Json::parse(files.text("test_targets_bop19.json"))) {
    CHECK(test::split_of(files, target.at("im_id")) == "val");
    CHECK(target.at("inst_count") == 1);
  }
}

namespace {

BopModel model_of(const Mesh& mesh, const Affine& place) {
  BopModel model;
  for (const Vec3f& point : mesh.positions) {
    model.positions.push_back((place * point.cast<double>()).cast<float>());
  }
  model.triangles = mesh.triangles;
  return model;
}

Affine somewhere() {
  Affine place = Affine::Identity();
  place.linear() = Eigen::AngleAxisd(0.7, Vec3(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  place.translation() = Vec3(3.0, -2.0, 5.0);
  return place;
}

/// A flat prism over a polygon of equal corners; `sides` 3 is a wedge.
Mesh prism(int sides, float radius, float height) {
  Mesh mesh;
  for (int i = 0; i < sides; ++i) {
    const float angle = float(2.0 * kPi * i / sides);
    for (const float z : {-0.5f * height, 0.5f * height}) {
      mesh.positions.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  }
  for (int i = 0; i < sides; ++i) {
    const auto a = std::uint32_t(2 * i), b = std::uint32_t(2 * ((i + 1) % sides));
    mesh.triangles.push_back({a, b, b + 1});
    mesh.triangles.push_back({a, b + 1, a + 1});
    if (i == 0 || i == sides - 1) continue;
    mesh.triangles.push_back({0, b, a});
    mesh.triangles.push_back({1, a + 1, b + 1});
  }
  return mesh;
}

struct Expected {
  const char* what;
  Mesh mesh;
  std::size_t continuous;
  std::size_t discrete;
};

}  // namespace

TEST_CASE("symmetries are those of the shape", "[writers]") {
  Mesh mug = make_cylinder(0.1, 0.3, 40);
  const Mesh handle = make_box({0.1, 0.03, 0.16});
  const auto first = std::uint32_t(mug.positions.size());
  for (const Vec3f& point : handle.positions)
    mug.positions.push_back(point + Vec3f(0.14f, 0, 0.03f));
  for (const auto& [a, b, c] : handle.triangles) {
    mug.triangles.push_back({first + a, first + b, first + c});
  }
  const std::vector<Expected> shapes{{"box", make_box({0.1, 0.2, 0.3}), 0, 3},
                                     {"square box", make_box({0.2, 0.2, 0.3}), 0, 7},
                                     {"cube", make_box({0.2, 0.2, 0.2}), 0, 23},
                                     {"sphere", make_sphere(0.1, 48), 3, 0},
                                     {"cylinder", make_cylinder(0.1, 0.3, 48), 1, 1},
                                     {"cone", make_cone(0.1, 0.3, 48), 1, 0},
                                     {"mug", mug, 0, 0},
                                     {"hexagonal prism", prism(6, 0.1f, 0.05f), 0, 11},
                                     {"triangular prism", prism(3, 0.1f, 0.3f), 0, 5}};
  for (const Expected& shape : shapes) {
    for (const Affine& place : {Affine(Affine::Identity()), somewhere()}) {
      CAPTURE(shape.what, place.translation().x());
      const BopModel model = model_of(shape.mesh, place);
      const double tolerance = 0.01 * model.diameter();
      const ModelSymmetries found = find_symmetries(model, tolerance);
      CHECK(found.continuous.size() == shape.continuous);
      CHECK(found.discrete.size() == shape.discrete);
      for (const Affine& map : found.discrete) {
        CHECK(map.linear().isUnitary(1e-6));
        CHECK((map.linear() - Mat3::Identity()).norm() > 0.05);
        // Every corner comes to another one, but for the round shapes, which have none.
        if (shape.continuous > 0) continue;
        for (const Vec3f& point : model.positions) {
          double nearest = kInfinity;
          for (const Vec3f& other : model.positions) {
            nearest = std::min(nearest, (map * point.cast<double>() - other.cast<double>()).norm());
          }
          CHECK(nearest < tolerance);
        }
      }
      const Vec3 axis = place.linear() * Vec3::UnitZ();
      if (shape.continuous == 1) {
        CHECK(std::abs(found.continuous[0].direction.dot(axis)) == Approx(1.0).epsilon(1e-4));
        CHECK((found.continuous[0].point - place.translation()).cross(axis).norm() < tolerance);
      }
    }
  }
  CHECK(find_symmetries(model_of(make_box({0.1, 0.2, 0.3}), somewhere()), 0.0).discrete.empty());
}
