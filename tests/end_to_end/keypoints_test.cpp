// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;
using Json = nlohmann::json;

namespace {

/// A board of 0.4 x 0.3 m whose upper corner and lower middle have names: one in the file, one
/// beside.
const std::string kBoard = R"(#usda 1.0
(
    defaultPrim = "Board"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Board"
{
    def Mesh "Plate"
    {
        point3f[] points = [(-0.2, -0.15, 0), (0.2, -0.15, 0), (0.2, 0.15, 0), (-0.2, 0.15, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
    }
    def Xform "Corner"
    {
        custom string diorama:keypoint = "corner"
        double3 xformOp:translate = (0.2, 0.15, 0.001)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
)";

const std::string kKeypointJob = R"(
seed: 4
total_captures: 4
environments: [{type: shapes, shapes: [cube]}]
objects:
  - {type: files, files: [board.usda], name: boards, label: board, count: 2, keypoints: [corner, edge]}
  - {type: shapes, name: others, count: 2, label_pattern: "^"}
cameras: [{type: pinhole, name: cam, width: 160, height: 120}]
lights: [{type: dome, name: sky}]
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.6, 0.6], [-0.6, 0.6], [1.2, 1.8]]}
  - {type: orbit_cameras, name: view, on: [still], targets: "/Assets/*board*", distance: [0.8, 1.2],
     polar_angle_deg: [10, 60]}
physics: {type: none}
renderer: {type: "null"}
timeline: [{capture: still, count: 2}]
writers:
  - {type: PoseWriter, name: pose, named_keypoints: true}
  - {type: CocoWriter, name: coco, val_share: 0}
  - {type: YoloWriter, name: yolo, task: pose, val_share: 0}
)";

}  // namespace

TEST_CASE("Named keypoints reach the labels, and lint agrees with them", "[run]") {
  const TemporaryFolder folder;
  write_file(folder / "board.usda", kBoard);
  write_file(folder / "board.keypoints.yaml", "keypoints:\n  edge: [0, -0.15, 0.001]\n");
  write_file(folder / "job.yaml", kKeypointJob);
  const Outcome outcome = run({"run", "job.yaml", "--output", "out"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const Json coco = Json::parse(read_file(folder / "out/coco/annotations/instances_train.json"));
  std::map<int, Json> names;
  for (const Json& category : coco["categories"]) names[category["id"]] = category;
  int boards = 0;
  int seen = 0;
  for (const Json& annotation : coco["annotations"]) {
    const Json& category = names.at(annotation["category_id"]);
    CHECK(annotation["keypoints"].size() == 3 * category["keypoints"].size());
    if (category["name"] != "board") continue;
    ++boards;
    CHECK(category["keypoints"] == Json::array({"corner", "edge"}));
    const auto box = annotation["bbox"].get<std::vector<double>>();
    for (std::size_t i = 0; i < 6; i += 3) {
      if (annotation["keypoints"][i + 2] != 2) continue;
      ++seen;
      // What is seen of a flat board lies in its box.
      CHECK(annotation["keypoints"][i].get<double>() >= box[0] - 1.5);
      CHECK(annotation["keypoints"][i].get<double>() <= box[0] + box[2] + 1.5);
      CHECK(annotation["keypoints"][i + 1].get<double>() >= box[1] - 1.5);
      CHECK(annotation["keypoints"][i + 1].get<double>() <= box[1] + box[3] + 1.5);
    }
  }
  CHECK(boards > 0);
  CHECK(seen > 0);
  const Outcome lint = run({"lint", "out"}, folder.path());
  INFO(lint.output);
  CHECK(lint.exit_code == 0);
  // The file beside the asset is one of its files.
  CHECK_THAT(read_file(folder / "out/dataset.json"), ContainsSubstring("board.keypoints.yaml"));

  // A point that is moved is found.
  fs::path file;
  for (const auto& entry : fs::directory_iterator(folder / "out/pose")) {
    if (entry.path().extension() != ".json") continue;
    Json json = Json::parse(read_file(entry.path()));
    for (Json& object : json["objects"]) {
      if (!file.empty() || !object.contains("named_keypoints")) continue;
      for (Json& point : object["named_keypoints"]) {
        if (!file.empty() || point["visibility"] == 0) continue;
        point["projected"][0] = point["projected"][0].get<double>() + 3.0;
        file = entry.path();
      }
    }
    if (!file.empty()) {
      write_file(file, json.dump(2));
      break;
    }
  }
  REQUIRE_FALSE(file.empty());
  const Outcome found = run({"lint", "out/pose"}, folder.path());
  CHECK(found.exit_code != 0);
  CHECK_THAT(found.output + found.errors, ContainsSubstring("its point '"));

  write_file(folder / "board.keypoints.yaml", "keypoints:\n  edge: [0, -0.15]\n");
  const Outcome wrong = run({"run", "job.yaml", "--output", "wrong"}, folder.path());
  CHECK(wrong.exit_code != 0);
  CHECK_THAT(wrong.errors,
             ContainsSubstring("board.keypoints.yaml:2:") && ContainsSubstring("keypoints.edge"));
}
