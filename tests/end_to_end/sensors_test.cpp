// SPDX-License-Identifier: Apache-2.0
// Sensors during a run and from a stored dataset.
#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

constexpr const char* kEffects = R"(
annotators:
  - {type: camera_sensor, iso: 3200, red_shift_px: 1.5, blue_shift_px: -1}
  - {type: depth_sensor, baseline_m: 0.1, min_m: 0.1}
)";

/// Two captures; `cameras` of them have lenses that are not round numbers.
std::string job_of_cameras(const std::string& cameras) {
  return R"(
seed: 11
total_captures: 2
environments: [{type: files, files: [room.usda]}]
cameras: )" +
         cameras + R"(
physics: {type: none}
renderer: {type: "null"}
randomizers:
  - {type: camera_lens, on: [floating], focal_length_mm: [20, 30], principal_point_px: [-9, 9]}
timeline: [{capture: floating, count: 2}]
output: {folder: out}
writers:
  - {type: BasicWriter, name: stored, rgb: true, image_output_format: exr, camera_params: true,
     distance_to_image_plane: true}
  - {type: BasicWriter, name: seen, rgb: true, sensor_depth: true}
)" + kEffects;
}

constexpr const char* kRoom = R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World"
{
    def Cube "Near"
    {
        double size = 1
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Cube "Far"
    {
        double size = 6
        double3 xformOp:translate = (9, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
)";

constexpr const char* kTwoCameras = "[{type: pinhole, count: 2, width: 97, height: 61}]";
constexpr const char* kOneCamera =
    "[{type: opencv_pinhole, width: 97, height: 61, distortion: [-0.1, 0.03, 0.001, 0.002]}]";

Outcome run_sensors(const TemporaryFolder& folder, const std::string& text) {
  write_file(folder / "room.usda", kRoom);
  write_file(folder / "job.yaml", text);
  write_file(folder / "effects.yaml", kEffects);
  return run({"run", "job.yaml"}, folder.path());
}

std::string error_of(const TemporaryFolder& folder, std::vector<std::string> arguments, int code) {
  arguments.insert(arguments.begin(), "sensors");
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  CHECK(outcome.exit_code == code);
  return outcome.errors;
}

}  // namespace

TEST_CASE("sensors give the same bytes in a run and from what it stored", "[sensors]") {
  for (const char* cameras : {kTwoCameras, kOneCamera}) {
    const TemporaryFolder folder;
    const Outcome made = run_sensors(folder, job_of_cameras(cameras));
    INFO(made.errors);
    REQUIRE(made.exit_code == 0);
    CHECK_THAT(made.errors, !ContainsSubstring("warning"));
    const auto seen = tree(folder / "out" / "seen");
    CHECK(seen.size() == (cameras == kTwoCameras ? 9 : 5));  // metadata.txt, two files per frame
    for (const char* threads : {"1", "3"}) {
      const Outcome replay = run({"sensors", "out", "--effects", "effects.yaml", "--overwrite",
                                  "-o", "replay", "--threads", threads},
                                 folder.path());
      INFO(replay.errors);
      REQUIRE(replay.exit_code == 0);
      CHECK(difference(seen, tree(folder / "replay" / "stored")) == "");
    }
    // The job itself says the effects, too.
    const Outcome again =
        run({"sensors", "out", "--effects", "job.yaml", "-o", "again"}, folder.path());
    CHECK(again.exit_code == 0);
    CHECK(difference(seen, tree(folder / "again" / "stored")) == "");
    CHECK(run({"lint", "again"}, folder.path()).exit_code == 0);
    CHECK(run({"lint", "out"}, folder.path()).exit_code == 0);
  }
}

TEST_CASE("sensors change pictures and no label", "[sensors]") {
  const TemporaryFolder with;
  const TemporaryFolder without;
  const std::string labelled = job_of_cameras(kTwoCameras);
  std::string text = labelled;
  text.insert(text.find("  - {type: BasicWriter, name: seen"),
              "  - {type: BasicWriter, name: labels, distance_to_camera: true, normals: true,\n"
              "     instance_id_segmentation: true}\n");
  REQUIRE(run_sensors(with, text).exit_code == 0);
  std::string bare = text.substr(0, text.find("annotators:"));
  REQUIRE(run_sensors(without, bare).exit_code == 0);
  CHECK(difference(tree(with / "out" / "labels"), tree(without / "out" / "labels")) == "");
  CHECK(difference(tree(with / "out" / "stored"), tree(without / "out" / "stored")) == "");
  CHECK_THAT(difference(tree(with / "out" / "seen"), tree(without / "out" / "seen")),
             ContainsSubstring("differs: rp_cam_0/rgb/rgb_0000.png"));
}

TEST_CASE("what sensors cannot use is told", "[sensors]") {
  const TemporaryFolder folder;
  std::string text = job_of_cameras(kTwoCameras);
  text.replace(text.find("camera_params: true"), 19, "camera_params: false");
  REQUIRE(run_sensors(folder, text).exit_code == 0);
  CHECK_THAT(error_of(folder, {"out", "--effects", "effects.yaml"}, 2),
             ContainsSubstring("out: no writer stored what the effects need, camera, color_hdr, "
                               "distance_to_image_plane: stored lacks camera"));
  CHECK_THAT(error_of(folder, {"nowhere", "--effects", "effects.yaml"}, 2),
             ContainsSubstring("nowhere: holds no dataset.json; give the output folder of a run"));
  write_file(folder / "none.yaml", "seed: 1\n");
  CHECK_THAT(error_of(folder, {"out", "--effects", "none.yaml"}, 3),
             ContainsSubstring("none.yaml: the section 'annotators' is missing or empty"));
  write_file(folder / "wrong.yaml", "annotators: [{type: camera_sensor, isso: 100}]\n");
  CHECK_THAT(error_of(folder, {"out", "--effects", "wrong.yaml"}, 3),
             ContainsSubstring("wrong.yaml:1:") && ContainsSubstring("isso"));
  write_file(folder / "needy.yaml", "annotators: [{type: instance_ids}]\n");
  CHECK_THAT(error_of(folder, {"out", "--effects", "needy.yaml"}, 3),
             ContainsSubstring("instance_ids needs 'leaf_id', which stored datasets do not give"));
}

TEST_CASE("a cut file of the dataset is named", "[sensors]") {
  const TemporaryFolder folder;
  REQUIRE(run_sensors(folder, job_of_cameras(kTwoCameras)).exit_code == 0);
  const std::string name =
      "out/stored/rp_cam_1/distance_to_image_plane/"
      "distance_to_image_plane_0001.npy";
  write_file(folder / name, read_file(folder / name).substr(0, 1000));
  CHECK_THAT(error_of(folder, {"out", "--effects", "effects.yaml"}, 5),
             ContainsSubstring("distance_to_image_plane_0001.npy: holds"));
  CHECK_FALSE(fs::exists(folder / "sensors/stored/rp_cam_1/sensor_depth/sensor_depth_0001.npy"));
}

TEST_CASE("lint finds measurements that are none", "[sensors]") {
  const TemporaryFolder folder;
  REQUIRE(run_sensors(folder, job_of_cameras(kTwoCameras)).exit_code == 0);
  const std::string name = "out/seen/rp_cam_0/sensor_depth/sensor_depth_0000.npy";
  const std::string bytes = read_file(folder / name);
  for (const char* value : {"\x00\x00\xc0\x7f", "\x00\x00\x80\xbf"}) {  // not a number, -1
    write_file(folder / name, bytes.substr(0, bytes.size() - 4) + std::string(value, 4));
    const Outcome found = run({"lint", "out"}, folder.path());
    CHECK(found.exit_code == 7);
    CHECK_THAT(found.output, ContainsSubstring("1 values are neither a depth nor 0 for none"));
  }
}

TEST_CASE("a sensor that no writer asks for is warned of", "[sensors]") {
  const TemporaryFolder folder;
  std::string text = job_of_cameras(kTwoCameras);
  text.erase(text.find(", sensor_depth: true"), 20);
  const Outcome made = run_sensors(folder, text);
  CHECK(made.exit_code == 0);
  CHECK_THAT(made.errors,
             ContainsSubstring("annotators: depth_sensor does nothing, as no writer needs what "
                               "it makes (sensor_depth)"));
}

TEST_CASE("things that fall are blurred in the picture and sharp in the labels", "[sensors]") {
  // So short an exposure shows no motion, but draws the same random numbers.
  const auto with_exposure = [](const TemporaryFolder& folder, const char* seconds) {
    const Outcome made =
        run({"run", config_file("smoke.yaml"), "--output", "out", "--set",
             "renderer={type: embree, samples: 2}", "--set",
             std::string("cameras=[{type: pinhole, name: cam, count: 2, width: 64, height: 48, "
                         "exposure_time_s: ") +
                 seconds + "}]"},
            folder.path());
    INFO(made.errors);
    REQUIRE(made.exit_code == 0);
    return tree(folder / "out" / "basic");
  };
  const TemporaryFolder first;
  const TemporaryFolder second;
  const auto sharp = with_exposure(first, "1e-9");
  const auto blurred = with_exposure(second, "0.1");
  std::size_t changed = 0;
  for (const auto& [name, bytes] : sharp) {
    if (blurred.at(name) == bytes) continue;
    CHECK_THAT(name, ContainsSubstring("/rgb/"));
    ++changed;
  }
  CHECK(changed >= 2);
}
