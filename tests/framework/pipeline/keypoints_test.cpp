// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/keypoints.h"

#include <string>

#include "diorama/error.h"
#include "framework/annotators/instances.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;
using test::TemporaryFolder;

namespace {

/// /Assets/pen with the asset's own node /Assets/pen/pen, turned and moved, and a cap below it.
struct Pen {
  Scene scene;
  NodeId object = scene.create(scene.create(scene.root(), "Assets"), "pen");
  NodeId root = scene.create(object, "pen");
  NodeId cap = scene.create(root, "cap");
  Pen() {
    scene.edit(object).labels = {{"class", "pen"}};
    scene.edit(root).mesh = std::make_shared<const Mesh>(make_box(Vec3(0.2, 0.02, 0.02)));
    scene.set_pose(object, Affine(Eigen::Translation3d(5, 6, 7)));
    scene.set_pose(root, Affine(Eigen::AngleAxisd(kPi / 2, Vec3::UnitZ())));
    scene.set_pose(cap, Affine(Eigen::Translation3d(0.1, 0, 0) * Eigen::UniformScaling<double>(2)));
    scene.edit(cap).keypoints = {{"clip", Vec3(0.01, 0, 0.02)}, {"unwanted", Vec3(1, 1, 1)}};
  }
  std::vector<Keypoint> points() const { return instance_keypoints(scene, object); }
  Vec3 place(const std::string& name) const {
    for (const Keypoint& point : points()) {
      if (point.name == name) return point.position;
    }
    throw Error(ErrorKind::Internal, "no keypoint " + name);
  }
};

}  // namespace

TEST_CASE("Keypoints of an asset and of the file beside it are those of the object", "[spawn]") {
  const TemporaryFolder folder;
  folder.write("pen.keypoints.yaml", "keypoints:\n  tip: [-0.1, 0, 0.01]\n  spare: [9, 9, 9]\n");
  Pen pen;
  keep_keypoints(pen.scene, pen.object, pen.root, folder.path("pen.usd{look=red}"),
                 {"tip", "clip"});
  REQUIRE(pen.points().size() == 2);
  // Turned by a quarter: x becomes y.
  CHECK((pen.place("tip") - Vec3(0, -0.1, 0.01)).norm() < 1e-12);
  CHECK((pen.place("clip") - Vec3(0, 0.12, 0.04)).norm() < 1e-12);
}

TEST_CASE("The file beside an asset counts before the asset, and parts with labels are their own",
          "[spawn]") {
  const TemporaryFolder folder;
  folder.write("pen.keypoints.yaml", "keypoints: {clip: [0, 0, 0.5]}\n");
  Pen pen;
  keep_keypoints(pen.scene, pen.object, pen.root, folder.path("pen.usd"), {"clip"});
  CHECK((pen.place("clip") - Vec3(0, 0, 0.5)).norm() < 1e-12);
  Pen labelled;
  labelled.scene.edit(labelled.cap).labels = {{"class", "cap"}};
  CHECK(labelled.points().empty());
  CHECK(instance_keypoints(labelled.scene, labelled.cap).size() == 2);
}

TEST_CASE("Objects without wanted keypoints keep none, and wanted ones have to be there",
          "[spawn]") {
  Pen pen;
  keep_keypoints(pen.scene, pen.object, pen.root, "/nowhere/pen.usd", {});
  CHECK(pen.points().empty());
  Pen other;
  CHECK_THROWS_WITH(
      keep_keypoints(other.scene, other.object, other.root, "/nowhere/pen.usd", {"tip", "end"}),
      "/nowhere/pen.usd: has no keypoint 'tip', 'end', only 'clip', 'unwanted'; they are looked "
      "for "
      "in the file and in /nowhere/pen.keypoints.yaml");
  Pen made;
  made.scene.edit(made.cap).keypoints.clear();
  CHECK_THROWS_WITH(keep_keypoints(made.scene, made.object, made.root, "shape:cube", {"tip"}),
                    "shape:cube: has no keypoint 'tip', nor any other");
}

TEST_CASE("A wrong file of keypoints says where and what", "[spawn]") {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& text) {
    const std::string file = folder.write("pen.keypoints.yaml", text);
    Pen pen;
    try {
      keep_keypoints(pen.scene, pen.object, pen.root, folder.path("pen.usd"), {"tip"});
    } catch (const Error& wrong) {
      const std::string what = wrong.what();
      return what.starts_with(file) ? what.substr(file.size()) : what;
    }
    return std::string("no error");
  };
  CHECK_THAT(error("keypoints:\n  tip: [1, 2]\n"),
             ContainsSubstring(":2:") && ContainsSubstring("keypoints.tip"));
  CHECK_THAT(error("tip: [1, 2, 3]\n"),
             ContainsSubstring("expected 'keypoints: {tip: [0.1, 0, 0.02]}'"));
  CHECK_THAT(error("keypoints: {tip: [1, .inf, 3]}\n"), ContainsSubstring("keypoints.tip"));
  CHECK_THAT(error("keypoints: {tip: [1, 2, 3]}\nunits: cm\n"),
             ContainsSubstring("and nothing else"));
}
