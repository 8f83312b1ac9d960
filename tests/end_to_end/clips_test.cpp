// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <stdexcept>

#include "numpy_files.h"
#include "program.h"
#include "replicator_camera.h"
#include "support/catch.h"
#include "support/walk_and_run.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 72;

/// Things that turn, fall and float in front of cameras that go round them; two clips.
std::string clip_job(const std::string& record = "{fps: 24, seconds: 0.25}",
                     const std::string& captures = "12") {
  return R"(
seed: 11
total_captures: )" +
         captures + R"(
environments: [{type: shapes, shapes: [cube]}]
environment: {colliders: triangle_mesh}
objects:
  - {type: shapes, name: things, under: /Assets, count: 6, label_pattern: "^", gravity_disabled_chance: 0.3}
lights: [{type: dome, name: sky}]
cameras:
  - {type: pinhole, name: eyes, width: 96, height: 72, rig: [{name: left}, {name: right, position: [0.1, 0, 0]}]}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.6, 0.6], [-0.6, 0.6], [1.4, 2.0]], scale: [0.1, 0.2]}
  - {type: camera_path, name: path, on: [clip], kind: orbit, targets: "/Environment", distance: 3.0,
     polar_angle_deg: 40, turn_deg_s: 40, jitter_m: 0.01, jitter_deg: 0.5}
settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: 14}, {record: )" +
         record + R"(}]
writers:
  - {type: BasicWriter, name: basic, instance_segmentation: true, colorize_instance_segmentation: false,
     bounding_box_3d: true, camera_params: true, distance_to_camera: true, motion_vectors: true, velocities: true,
     channels: [flow_forward, flow_forward_state, flow_backward, flow_backward_state]}
output: {folder: out}
)";
}

std::map<std::string, std::string> clip_dataset(const std::vector<std::string>& more) {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", clip_job());
  std::vector<std::string> arguments{"run", "job.yaml"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  return tree(folder / "out");
}

const std::map<std::string, std::string>& whole_dataset() {
  static const auto files = clip_dataset({"--threads", "1"});
  return files;
}

/// What is known of one camera's frame, read without the program.
struct StoredView {
  StoredView(const std::map<std::string, std::string>& files, const std::string& camera,
             int index) {
    const std::string number = "000" + std::to_string(index);
    const std::string ending = number.substr(number.size() - 4);
    const auto file = [&](const std::string& kind, const std::string& stem,
                          const std::string& type) {
      const std::string name = stem + "_" + ending + type;
      // Where there is one camera, all files lie side by side.
      const auto own = files.find("basic/rp_" + camera + "/" + kind + "/" + name);
      return own != files.end() ? own->second : files.at("basic/" + name);
    };
    const auto array = [&](const std::string& kind) { return parse_npy(file(kind, kind, ".npy")); };
    forward = array("flow_forward");
    backward = array("flow_backward");
    forward_state = array("flow_forward_state");
    backward_state = array("flow_backward_state");
    motion = array("motion_vectors");
    distance = array("distance_to_camera");
    lens = camera_of(Json::parse(file("camera_params", "camera_params", ".json")));
    ids = parse_picture(file("instance_segmentation", "instance_segmentation", ".png"), "ids");
    const Json mapping =
        Json::parse(file("instance_segmentation", "instance_segmentation_mapping", ".json"));
    for (const auto& [id, path] : mapping.items()) paths[std::uint32_t(std::stoul(id))] = path;
    const NpyArray boxes = array("bounding_box_3d");
    const Json box_paths =
        Json::parse(file("bounding_box_3d", "bounding_box_3d_prim_paths", ".json"));
    for (std::size_t row = 0; row < box_paths.size(); ++row) {
      Affine pose;
      for (std::size_t i = 0; i < 16; ++i) {
        pose.matrix()(Eigen::Index(i % 4), Eigen::Index(i / 4)) =
            boxes.value<float>(96 * row + 28 + 4 * i);
      }
      poses.emplace(box_paths[row].get<std::string>(), pose);
    }
    velocities = Json::parse(file("velocities", "velocities", ".json"));
  }

  static std::size_t place(int x, int y) { return std::size_t(y * kWidth + x); }
  Vec2 flow(const NpyArray& array, int x, int y) const {
    return {array.value<float>(8 * place(x, y)), array.value<float>(8 * place(x, y) + 4)};
  }
  static std::uint32_t state(const NpyArray& array, int x, int y) {
    return array.value<std::uint32_t>(4 * place(x, y));
  }
  float distance_at(int x, int y) const { return distance.value<float>(4 * place(x, y)); }
  /// Empty: no object.
  std::string path_at(int x, int y) const {
    const auto found = paths.find(ids.packed(x, y));
    return found != paths.end() && poses.contains(found->second) ? found->second : "";
  }
  Vec3 point_at(int x, int y) const {
    const Vec3 ray = Vec3((x + 0.5 - lens.lens.centre.x()) / lens.lens.focal.x(),
                          (y + 0.5 - lens.lens.centre.y()) / lens.lens.focal.y(), 1.0)
                         .normalized();
    return lens.camera_from_world.inverse() * Vec3(ray * double(distance_at(x, y)));
  }

  NpyArray forward, backward, forward_state, backward_state, motion, distance;
  ReplicatorCamera lens;
  Picture ids;
  std::map<std::uint32_t, std::string> paths;
  std::map<std::string, Affine> poses;
  Json velocities;
};

struct FlowErrors {
  std::vector<double> off;  ///< Pixels between the flow's end and where the point is.
  int seen = 0, hidden = 0, outside = 0, wrong_ids = 0, wrongly_hidden = 0, wrong_states = 0;
};

/// Follows every pixel of `from` into `to`.
void follow(const StoredView& from, const StoredView& to, bool forward, FlowErrors& errors) {
  const NpyArray& flows = forward ? from.forward : from.backward;
  const NpyArray& states = forward ? from.forward_state : from.backward_state;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const std::uint32_t state = StoredView::state(states, x, y);
      if (!std::isfinite(from.distance_at(x, y))) {
        errors.wrong_states += state == 3 ? 0 : 1;
        continue;
      }
      const std::string path = from.path_at(x, y);
      Vec3 point = from.point_at(x, y);
      // Who has left the picture is in none of its files.
      if (!path.empty() && !to.poses.contains(path)) continue;
      if (!path.empty()) point = to.poses.at(path) * (from.poses.at(path).inverse() * point);
      const Vec3 in_camera = to.lens.camera_from_world * point;
      const auto pixel = to.lens.lens.pixel(in_camera);
      if (!pixel) throw std::runtime_error("a point behind the camera");
      const Vec2 found = Vec2(x + 0.5, y + 0.5) + from.flow(flows, x, y);
      errors.off.push_back((found - *pixel).norm());
      const int there_x = int(std::floor(found.x()));
      const int there_y = int(std::floor(found.y()));
      const bool is_inside = there_x >= 0 && there_y >= 0 && there_x < kWidth && there_y < kHeight;
      errors.wrong_states += is_inside == (state != 2) ? 0 : 1;
      if (state == 2) ++errors.outside;
      if (state == 0) {
        ++errors.seen;
        if (to.path_at(there_x, there_y) != path) ++errors.wrong_ids;
      }
      if (state == 1) {
        ++errors.hidden;
        // Pixels are coarse: what is in front may be seen in the next one only.
        double nearest = 1e9;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const int nx = std::clamp(there_x + dx, 0, kWidth - 1);
            const int ny = std::clamp(there_y + dy, 0, kHeight - 1);
            nearest = std::min(nearest, double(to.distance_at(nx, ny)));
          }
        }
        if (nearest > in_camera.norm()) ++errors.wrongly_hidden;
      }
    }
  }
}

}  // namespace

TEST_CASE("Flow leads to where the same points are in the next and the last frame", "[run]") {
  const auto& files = whole_dataset();
  for (const bool forward : {true, false}) {
    FlowErrors errors;
    for (const char* camera : {"eyes_0_left", "eyes_0_right"}) {
      for (int first : {0, 6}) {
        for (int i = 0; i < 5; ++i) {
          const StoredView a(files, camera, first + i);
          const StoredView b(files, camera, first + i + 1);
          follow(forward ? a : b, forward ? b : a, forward, errors);
          // Motion is the flow backwards, turned round; the format counts it to the left and up.
          const Vec2 flow = b.flow(b.backward, 48, 36);
          CHECK(std::abs(b.motion.value<float>(16 * StoredView::place(48, 36)) - flow.x()) < 1e-5);
        }
      }
    }
    std::ranges::sort(errors.off);
    CAPTURE(forward, errors.seen, errors.hidden, errors.outside, errors.wrong_ids);
    CHECK(errors.seen > 20000);
    CHECK(errors.wrong_states == 0);
    CHECK(errors.hidden > 100);
    CHECK(errors.outside > 100);
    CHECK(errors.off[errors.off.size() / 2] < 0.01);
    CHECK(errors.off.back() < 0.1);
    // At outlines the centre of the pixel that a point falls into may show something else.
    CHECK(errors.wrong_ids < 0.02 * errors.seen);
    CHECK(errors.wrongly_hidden < 0.02 * errors.hidden);
  }
}

TEST_CASE("A clip says which frames it has, and has none before or behind it", "[run]") {
  const auto& files = whole_dataset();
  const Json clips = Json::parse(files.at("basic/clips.json")).at("clips");
  REQUIRE(clips.size() == 2);
  CHECK(clips[1].at("first_capture") == 6);
  CHECK(clips[1].at("frame_count") == 6);
  CHECK(clips[1].at("fps") == 24.0);
  for (const int first : {0, 6}) {
    const StoredView begin(files, "eyes_0_left", first);
    const StoredView end(files, "eyes_0_left", first + 5);
    int known = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        known += StoredView::state(begin.backward_state, x, y) == 3 ? 0 : 1;
        known += StoredView::state(end.forward_state, x, y) == 3 ? 0 : 1;
        known += begin.flow(begin.backward, x, y).isZero() ? 0 : 1;
      }
    }
    CHECK(known == 0);
  }
}

TEST_CASE("Between frames things fall for just as long as the frame rate says", "[run]") {
  const auto& files = whole_dataset();
  int falling = 0;
  for (int i = 0; i < 5; ++i) {
    const StoredView a(files, "eyes_0_left", i);
    const StoredView b(files, "eyes_0_left", i + 1);
    for (const auto& [path, velocity] : a.velocities.items()) {
      if (!b.velocities.contains(path) || !a.poses.contains(path) || !b.poses.contains(path)) {
        continue;
      }
      const Json& later = b.velocities.at(path);
      const double dv =
          later.at("linear")[2].get<double>() - velocity.at("linear")[2].get<double>();
      // In free fall; what floats, or meets something, does not count here.
      if (std::abs(dv + 9.81 / 24.0) > 0.02) continue;
      ++falling;
      const double dz = b.poses.at(path).translation().z() - a.poses.at(path).translation().z();
      const double mean =
          0.5 * (later.at("linear")[2].get<double>() + velocity.at("linear")[2].get<double>());
      CHECK(std::abs(dz - mean / 24.0) < 0.005);
    }
  }
  CHECK(falling >= 5);
}

TEST_CASE("A path is drawn once per clip, and objects keep their places in between", "[run]") {
  const auto& files = whole_dataset();
  const auto centre = [&](int index) {
    const StoredView view(files, "eyes_0_left", index);
    return Vec3(view.lens.camera_from_world.inverse().translation());
  };
  double longest = 0.0;
  for (const int first : {0, 6}) {
    for (int i = 0; i < 5; ++i)
      longest = std::max(longest, (centre(first + i + 1) - centre(first + i)).norm());
  }
  // 40 degrees a second at 1.9 m from the axis, and the shaking.
  CHECK(longest < 0.12);
  CHECK(longest > 0.03);
  CHECK((centre(6) - centre(0)).norm() > 0.3);
  const StoredView a(files, "eyes_0_left", 2);
  const StoredView right(files, "eyes_0_right", 2);
  CHECK(std::abs((Vec3(right.lens.camera_from_world.inverse().translation()) - centre(2)).norm() -
                 0.1) < 1e-6);
}

TEST_CASE("Clips are the same bytes for any threads, visits in flight, shards and after kills",
          "[run]") {
  const auto& expected = whole_dataset();
  CHECK(difference(expected, clip_dataset({"--threads", "3", "--visits-in-flight", "2"})) == "");
  {
    const TemporaryFolder folder;
    write_file(folder / "job.yaml", clip_job());
    for (const char* shard : {"2/2", "1/2"}) {
      CHECK(run({"run", "job.yaml", "--shard", shard}, folder.path()).exit_code == 0);
      // Six frames each: a shard has whole clips.
      CHECK(journal_entries(folder / "out") == (shard[0] == '2' ? 6 : 12));
    }
    CHECK(difference(expected, tree(folder / "out")) == "");
  }
  {
    // Workers that take visits, one of which dies in a clip.
    const TemporaryFolder folder;
    write_file(folder / "job.yaml", clip_job());
    std::vector<Process> workers;
    for (int i = 0; i < 3; ++i) {
      const fs::path place = folder / ("worker" + std::to_string(i));
      fs::create_directories(place);
      workers.emplace_back(std::vector<std::string>{"run", "../job.yaml", "--output", "../out",
                                                    "--shard", "auto", "--threads", "1"},
                           place);
    }
    CHECK(wait_for_captures(folder / "out", 2));
    workers[0].signal(SIGKILL);
    for (Process& worker : workers) {
      const Outcome outcome = worker.wait();
      INFO(outcome.errors);
      if (&worker != &workers[0]) CHECK(outcome.exit_code == 0);
    }
    CHECK(run({"run", "job.yaml", "--shard", "auto"}, folder.path()).exit_code == 0);
    CHECK(difference(expected, tree(folder / "out")) == "");
  }
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", clip_job());
  const std::vector<std::string> arguments{"run", "job.yaml", "--resume"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "out", {2, 8}));
  CHECK(journal_entries(folder / "out") < 12);
  CHECK(run(arguments, folder.path()).exit_code == 0);
  CHECK(difference(expected, tree(folder / "out")) == "");
}

TEST_CASE("Paths of every kind go on after kills, and so does what a visit reports", "[run]") {
  const std::string job = R"(
seed: 3
total_captures: 10
environments: [{type: shapes, shapes: [cube]}]
environment: {colliders: triangle_mesh}
objects:
  - {type: shapes, name: things, under: /Assets, count: 4, label_pattern: "^", gravity_disabled_chance: 0.3}
lights: [{type: dome, name: sky}]
cameras:
  - {type: pinhole, name: orbit, width: 48, height: 36}
  - {type: pinhole, name: follow, width: 48, height: 36, exposure_time_s: 0.01}
  - {type: pinhole, name: walk, width: 48, height: 36}
  - {type: pinhole, name: keys, width: 48, height: 36}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.6, 0.6], [-0.6, 0.6], [1.4, 2.0]], scale: [0.1, 0.2]}
  - {type: camera_path, name: a, on: [clip], nodes: "/Cameras/orbit_0", kind: orbit, targets: "/Environment",
     distance: 3.0, turn_deg_s: 40, jitter_m: 0.01, jitter_deg: 0.5}
  - {type: camera_path, name: b, on: [clip], nodes: "/Cameras/follow_0", kind: follow, offset: [0.2, 0, 0],
     jitter_m: 0.01}
  - {type: camera_path, name: c, on: [clip], nodes: "/Cameras/walk_0", kind: walk, area: [[-3, 3], [-3, 3], 1.2],
     look: ahead}
  - {type: camera_path, name: d, on: [clip], nodes: "/Cameras/keys_0", kind: keys, keys: [
     {time_s: 0, position: [[2, 3], 0, 1]}, {time_s: 0.1, position: [0, 3, 2]}, {time_s: 0.3, position: [-3, 0, 1]}]}
settle: {policy: keep}
renderer: {type: "null"}
timeline: [{simulate: 14}, {record: {fps: 20, seconds: 0.25}}]
writers:
  - {type: BasicWriter, name: basic, camera_params: true, distance_to_camera: true, motion_vectors: true,
     velocities: true, channels: [flow_forward, flow_backward]}
output: {folder: out}
)";
  const TemporaryFolder folder;
  write_file(folder / "whole/job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder / "whole");
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto expected = tree(folder / "whole/out");
  // What the camera that follows is too near to is told of each frame, whoever made it.
  const Json report = Json::parse(expected.at("settle/0_cube.json"));
  CHECK(report.at("blocked_cameras").size() >= 3);
  write_file(folder / "job.yaml", job);
  const std::vector<std::string> arguments{"run", "job.yaml", "--resume"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "out", {2, 4}));
  CHECK(run(arguments, folder.path()).exit_code == 0);
  CHECK(difference(expected, tree(folder / "out")) == "");
  // The way through the room is that of the whole clip, however much of it is recorded.
  write_file(folder / "cut/job.yaml", job);
  REQUIRE(run({"run", "job.yaml", "--set", "total_captures=8"}, folder / "cut").exit_code == 0);
  auto cut = tree(folder / "cut/out");
  CHECK_FALSE(cut.contains("settle/1_cube.json"));
  for (const char* camera : {"orbit", "follow", "walk", "keys"}) {
    const std::string name =
        "basic/rp_" + std::string(camera) + "_0/camera_params/camera_params_0007.json";
    CHECK(cut.at(name) == expected.at(name));
  }
}

/// A sheet that grows by half of its first size per second, and bends as it does.
std::string growing_sheet() {
  std::string first, last, counts, indices;
  const auto put = [](std::string& list, const std::string& text) {
    list += (list.empty() ? "" : ", ") + text;
  };
  constexpr int kQuads = 8;
  for (int y = 0; y <= kQuads; ++y) {
    for (int x = 0; x <= kQuads; ++x) {
      const double u = double(x) / kQuads - 0.5, v = double(y) / kQuads - 0.5;
      const auto point = [&](double scale) {
        return "(" + std::to_string(scale * u) + ", " + std::to_string(scale * 0.2 * u * v) + ", " +
               std::to_string(scale * v) + ")";
      };
      put(first, point(1.0));
      put(last, point(1.5));
    }
  }
  for (int y = 0; y < kQuads; ++y) {
    for (int x = 0; x < kQuads; ++x) {
      const int a = y * (kQuads + 1) + x;
      put(counts, "4");
      put(indices, std::to_string(a) + ", " + std::to_string(a + 1) + ", " +
                       std::to_string(a + kQuads + 2) + ", " + std::to_string(a + kQuads + 1));
    }
  }
  return R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
    timeCodesPerSecond = 24
    startTimeCode = 0
    endTimeCode = 24
)
def Mesh "Sheet"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [)" +
         counts + "]\n    int[] faceVertexIndices = [" + indices +
         "]\n    point3f[] points.timeSamples = { 0: [" + first + "], 24: [" + last + "] }\n}\n";
}

std::string growing_job(const std::string& renderer) {
  return R"(
seed: 4
total_captures: 6
environments: [{type: shapes, shapes: [cube]}]
objects:
  - {type: files, files: [sheet.usda], name: sheet, under: /Assets, label: sheet, collider: none,
     gravity_disabled_chance: 1.0}
lights: [{type: dome, name: sky, intensity: 100}]
cameras:
  - {type: pinhole, name: cam, width: 96, height: 72, position: [0.3, -4, 2.5], look_at: [0, 0, 2]}
randomizers:
  - {type: scatter_poses, name: place, on: [environment], nodes: "/Assets/*", offset: [0, 0, 2],
     rotation: none, avoid_overlap: false}
  - {type: animation_time, name: grow, on: [clip], nodes: "/Assets/**", time_s: 0.25}
settle: {policy: keep}
physics: {type: none}
renderer: )" +
         renderer + R"(
timeline: [{record: {fps: 12, seconds: 0.5}}]
writers:
  - {type: BasicWriter, name: basic, rgb: true, instance_segmentation: true, colorize_instance_segmentation: false,
     bounding_box_3d: true, camera_params: true, distance_to_camera: true, motion_vectors: true, velocities: true,
     channels: [flow_forward, flow_forward_state, flow_backward, flow_backward_state]}
output: {folder: out}
)";
}

TEST_CASE("An animation plays in a clip, and flow goes with what bends", "[run]") {
  const TemporaryFolder folder;
  write_file(folder / "sheet.usda", growing_sheet());
  write_file(folder / "job.yaml", growing_job("{type: \"null\"}"));
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto files = tree(folder / "out");
  const Vec3 place(0.0, 0.0, 2.0);
  const auto scale = [](int frame) { return 1.0 + 0.5 * (0.25 + frame / 12.0); };
  int seen = 0;
  double worst = 0.0;
  for (int i = 0; i < 6; ++i) {
    const StoredView view(files, "cam_0", i);
    for (const int other : {i - 1, i + 1}) {
      if (other < 0 || other > 5) continue;
      const NpyArray& flow = other > i ? view.forward : view.backward;
      const NpyArray& state = other > i ? view.forward_state : view.backward_state;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (!view.path_at(x, y).starts_with("/Assets")) continue;
          const Vec3 there = place + scale(other) / scale(i) * (view.point_at(x, y) - place);
          const Vec2 expected = *view.lens.lens.pixel(Vec3(view.lens.camera_from_world * there));
          worst =
              std::max(worst, (Vec2(x + 0.5, y + 0.5) + view.flow(flow, x, y) - expected).norm());
          seen += StoredView::state(state, x, y) == 0 ? 1 : 0;
        }
      }
    }
  }
  CHECK(seen > 3000);
  CHECK(worst < 0.01);
}

TEST_CASE("What an animation moves pushes what is in its way", "[run]") {
  const TemporaryFolder folder;
  // From x = -1 to 1 in two seconds.
  write_file(folder / "yard.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
    timeCodesPerSecond = 24
    startTimeCode = 0
    endTimeCode = 48
)
def Cube "Floor"
{
    double3 xformOp:translate = (0, 0, -1)
    float3 xformOp:scale = (4, 4, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
def Cube "Pusher"
{
    double3 xformOp:translate.timeSamples = { 0: (-1, 0, 0.5), 48: (1, 0, 0.5) }
    float3 xformOp:scale = (0.1, 2, 0.5)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
)");
  std::string job = growing_job("{type: \"null\"}");
  const auto replace = [&](const std::string& from, const std::string& to) {
    job.replace(job.find(from), from.size(), to);
  };
  replace("[{type: shapes, shapes: [cube]}]",
          "[{type: files, files: [yard.usda]}]\nenvironment: {colliders: triangle_mesh}");
  replace(
      "{type: files, files: [sheet.usda], name: sheet, under: /Assets, label: sheet, collider: "
      "none,\n     gravity_disabled_chance: 1.0}",
      "{type: shapes, shapes: [cube], name: box, under: /Assets, label: box}");
  replace("offset: [0, 0, 2]", "scale: 0.1, offset: [-0.6, 0, 0.101]");
  replace("look_at: [0, 0, 2]", "look_at: [0, 0, 0]");
  replace("nodes: \"/Assets/**\", time_s: 0.25", "nodes: \"/Environment/**\", time_s: 0");
  replace("physics: {type: none}\n", "");
  replace("timeline: [{record: {fps: 12, seconds: 0.5}}]",
          "timeline: [{record: {fps: 4, seconds: 1.5}}]");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto files = tree(folder / "out");
  for (int frame = 0; frame < 6; ++frame) {
    const StoredView view(files, "cam_0", frame);
    REQUIRE(view.poses.size() == 1);
    // The pusher's face is 0.1 m before its middle, the box's 0.1 m behind its own.
    const double touching = -1.0 + frame / 4.0 + 0.1 + 0.1;
    const double x = view.poses.begin()->second.translation().x();
    CHECK(x > std::max(-0.6, touching) - 0.02);
    CHECK(x < std::max(-0.6, touching) + 0.1);
  }
}

TEST_CASE("Inspect lists the animations of a file of which a job chooses one", "[run]") {
  const TemporaryFolder folder;
  write_file(
      folder / "mover.x",
      walk_and_run(
          "4; 0;0;0;, 0.5;0;0;, 0;0.5;0;, 0;0;0.5;; 4; 3;0,1,2;, 3;0,1,3;, 3;0,2,3;, 3;1,2,3;;"));
  const Outcome inspected = run({"inspect", "mover.x"}, folder.path());
  INFO(inspected.errors);
  REQUIRE(inspected.exit_code == 0);
  CHECK_THAT(inspected.output, ContainsSubstring("animation 0 'Walk' lasts 2 s"));
  CHECK_THAT(inspected.output, ContainsSubstring("animation 1 'Run' lasts 1 s"));
  CHECK_THAT(inspected.output, ContainsSubstring("moves from 0 to 2 s"));
  const Outcome second = run({"inspect", "mover.x{animation=Run}"}, folder.path());
  CHECK_THAT(second.output, ContainsSubstring("moves from 0 to 1 s"));

  std::string job = growing_job("{type: \"null\"}");
  const auto replace = [&](const std::string& from, const std::string& to) {
    job.replace(job.find(from), from.size(), to);
  };
  replace("sheet.usda", "mover.x");
  replace("time_s: 0.25", "time_s: 0, animation: Run");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  // 5 m/s, at 12 frames per second.
  const auto files = tree(folder / "out");
  const StoredView first(files, "cam_0", 0);
  int seen = 0;
  double worst = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (!first.path_at(x, y).starts_with("/Assets")) continue;
      const Vec3 there = first.point_at(x, y) + Vec3(5.0 / 12.0, 0.0, 0.0);
      const Vec2 expected = *first.lens.lens.pixel(Vec3(first.lens.camera_from_world * there));
      const Vec2 moved = Vec2(x + 0.5, y + 0.5) + first.flow(first.forward, x, y);
      worst = std::max(worst, (moved - expected).norm());
      ++seen;
    }
  }
  CHECK(seen > 20);
  CHECK(worst < 0.01);

  replace("animation: Run", "animation: Rum");
  write_file(folder / "job.yaml", job);
  const Outcome failed = run({"run", "job.yaml", "--overwrite"}, folder.path());
  CHECK(failed.exit_code != 0);
  CHECK_THAT(failed.errors, ContainsSubstring("found the animation 'Rum'"));
  CHECK_THAT(failed.errors, ContainsSubstring("did you mean 'Run'?"));
}

TEST_CASE("Clips of what bends are the same bytes after kills, and whatever was shown before",
          "[run]") {
  const std::string job = growing_job("{type: embree, samples: 2, max_bounces: 2}");
  const auto prepare = [&](const fs::path& place) {
    write_file(place / "job.yaml", job);
    write_file(place / "sheet.usda", growing_sheet());
  };
  const TemporaryFolder folder;
  prepare(folder / "whole");
  const Outcome outcome = run({"run", "job.yaml"}, folder / "whole");
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto expected = tree(folder / "whole/out");
  prepare(folder.path());
  const std::vector<std::string> arguments{"run", "job.yaml", "--resume"};
  REQUIRE(run_and_kill(arguments, folder.path(), folder / "out", {2, 4}));
  CHECK(run(arguments, folder.path()).exit_code == 0);
  CHECK(difference(expected, tree(folder / "out")) == "");
}

TEST_CASE("Formats with tracks call one object the same in every frame, and are read back",
          "[run]") {
  const TemporaryFolder folder;
  std::string job = clip_job();
  job.insert(job.find("output:"),
             R"(  - {type: CocoWriter, name: coco, youtube_vis: true, val_share: 0.5}
  - {type: MotWriter, name: mot, val_share: 0.5}
  - {type: KittiWriter, name: kitti, layout: tracking, val_share: 0.5}
)");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto files = tree(folder / "out");

  // By split, clip, camera, frame: node to track, from COCO.
  std::map<std::string, std::map<int, std::map<std::string, int>>> track_of;
  std::set<std::string> coco_boxes;
  for (const std::string split : {"train", "val"}) {
    const Json coco = Json::parse(files.at("coco/annotations/instances_" + split + ".json"));
    REQUIRE(coco.at("images").size() == 12);  // one clip, two cameras
    std::map<int, Json> images;
    for (const Json& image : coco.at("images")) images[image.at("id")] = image;
    for (const Json& annotation : coco.at("annotations")) {
      const Json& image = images.at(annotation.at("image_id"));
      CHECK(std::abs(image.at("time_s").get<double>() - image.at("frame_index").get<int>() / 24.0) <
            1e-8);
      const int clip = (image.at("video_id").get<int>() - 1) / 2;
      const std::string sequence =
          split + "/clip_000" + std::to_string(clip) + "_" + image.at("camera").get<std::string>();
      const int frame = image.at("frame_index").get<int>() + 1;
      auto& tracks = track_of[sequence][frame];
      tracks[annotation.at("node")] = annotation.at("track_id");
      const Json& box = annotation.at("bbox");
      coco_boxes.insert(
          sequence + " " + std::to_string(frame) + "," + annotation.at("track_id").dump() + "," +
          std::to_string(box[0].get<int>() + 1) + "," + std::to_string(box[1].get<int>() + 1) +
          "," + box[2].dump() + "," + box[3].dump() + ",1");
    }
    // Each track of YouTube-VIS is the annotations of its object.
    const Json vis = Json::parse(files.at("coco/youtube_vis/" + split + ".json"));
    REQUIRE(vis.at("videos").size() == 2);
    std::size_t masks = 0;
    for (const Json& video : vis.at("videos")) {
      CHECK(video.at("length") == 6);
      CHECK(video.at("file_names").size() == 6);
      for (const Json& name : video.at("file_names")) {
        CHECK(files.contains("coco/images/" + split + "/" + name.get<std::string>()));
      }
    }
    for (const Json& track : vis.at("annotations")) {
      CHECK(track.at("segmentations").size() == 6);
      for (std::size_t i = 0; i < 6; ++i) {
        CHECK(track.at("segmentations")[i].is_null() == track.at("bboxes")[i].is_null());
        masks += track.at("segmentations")[i].is_null() ? 0 : 1;
      }
    }
    CHECK(masks == coco.at("annotations").size());
  }
  for (const auto& [sequence, frames] : track_of) {
    std::map<std::string, int> of_clip;
    for (const auto& [frame, tracks] : frames) {
      for (const auto& [node, track] : tracks) {
        CHECK(of_clip.emplace(node, track).first->second == track);
      }
    }
    CHECK_FALSE(of_clip.empty());
  }

  std::set<std::string> mot_boxes;
  for (const auto& [name, text] : files) {
    if (!name.starts_with("mot/") || !name.ends_with("gt/gt.txt")) continue;
    const std::string sequence = name.substr(4, name.size() - 4 - 10);
    CHECK_THAT(files.at("mot/" + sequence + "/seqinfo.ini"),
               ContainsSubstring("frameRate=24\nseqLength=6\nimWidth=96\nimHeight=72"));
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      std::size_t end = 0;
      for (int i = 0; i < 7; ++i) end = line.find(',', end + (i > 0 ? 1 : 0));
      mot_boxes.insert(sequence + " " + line.substr(0, end));
    }
  }
  CHECK(mot_boxes == coco_boxes);

  std::size_t kitti_lines = 0;
  for (const char* sequence : {"0000", "0001", "0002", "0003"}) {
    std::istringstream lines(files.at(std::string("kitti/training/label_02/") + sequence + ".txt"));
    for (std::string line; std::getline(lines, line); ++kitti_lines) {
      std::istringstream words(line);
      std::size_t count = 0;
      for (std::string word; words >> word;) ++count;
      CHECK(count == 17);
    }
    CHECK(files.contains(std::string("kitti/training/calib/") + sequence + ".txt"));
    CHECK(files.contains(std::string("kitti/training/image_02/") + sequence + "/000005.png"));
  }
  CHECK(kitti_lines == coco_boxes.size());

  const Outcome lint = run({"lint", "out"}, folder.path());
  INFO(lint.output);
  CHECK(lint.exit_code == 0);
  // The reader of COCO knows clips and tracks, so the same sequences can be made of it.
  const Outcome converted =
      run({"convert", "out/coco", "--writer", "MotWriter name=again", "-o", "converted"},
          folder.path());
  INFO(converted.errors);
  CHECK(converted.exit_code == 0);
  const auto again = tree(folder / "converted");
  const auto without_visibility = [](const std::string& text) {
    std::string result;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      result += line.substr(0, line.rfind(',')) + "\n";
    }
    return result;
  };
  for (const auto& [path, text] : files) {
    if (!path.starts_with("mot/") || !path.ends_with("gt/gt.txt")) continue;
    CAPTURE(path);
    const auto same = again.find("again" + path.substr(3));
    REQUIRE(same != again.end());
    CHECK(without_visibility(same->second) == without_visibility(text));
  }

  // What is not right is found.
  const std::string broken =
      "out/mot/train/" +
      fs::directory_iterator(folder / "out/mot/train")->path().filename().string();
  const std::string gt = read_file(folder / (broken + "/gt/gt.txt"));
  const auto finding = [&](const std::string& text) {
    write_file(folder / (broken + "/gt/gt.txt"), text);
    const Outcome found = run({"lint", "out/mot"}, folder.path());
    CHECK(found.exit_code != 0);
    write_file(folder / (broken + "/gt/gt.txt"), gt);
    return found.output + found.errors;
  };
  const std::string first = gt.substr(0, gt.find('\n') + 1);
  CHECK_THAT(finding(gt + first), ContainsSubstring("twice"));
  CHECK_THAT(finding("7" + first.substr(1) + gt), ContainsSubstring("is of frame 7"));
  CHECK_THAT(finding("1,2,3\n" + gt), ContainsSubstring("line 1 has 3 fields, not 9"));
  fs::remove(folder / (broken + "/img1/000003.png"));
  CHECK(run({"lint", "out/mot"}, folder.path()).exit_code != 0);
}

TEST_CASE("Formats with a place for it say clip, frame and time of each picture", "[run]") {
  const TemporaryFolder folder;
  std::string job = clip_job("{fps: 24, seconds: 0.25}", "6");
  job.insert(job.find("output:"), R"(  - {type: WebDatasetWriter, name: web, val_share: 0}
  - {type: ImageFolderWriter, name: hugging, val_share: 0}
  - {type: PoseWriter, name: pose}
)");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const auto files = tree(folder / "out");
  // By capture, then camera; in an archive the texts of JSON stand as they are.
  std::string web;
  for (const auto& [path, bytes] : files) {
    if (path.starts_with("web/") && path.ends_with(".tar")) web += bytes;
  }
  std::istringstream rows(files.at("hugging/train/metadata.jsonl"));
  int number = 0;
  for (std::string line; std::getline(rows, line); ++number) {
    const Json row = Json::parse(line);
    CHECK(row.at("clip") == 0);
    CHECK(row.at("frame_index") == number / 2);
    CHECK(std::abs(row.at("time_s").get<double>() - number / 2 / 24.0) < 1e-8);
    const std::string text = R"("clip": 0, "frame_index": )" + std::to_string(number / 2) +
                             R"(, "time_s": )" + row.at("time_s").dump();
    CHECK_THAT(web, ContainsSubstring(text));
    const std::string pose = "000000" + std::to_string(number);
    const std::string file = "pose/" + pose.substr(pose.size() - 6) + ".json";
    CHECK(Json::parse(files.at(file)).at("frame_index") == number / 2);
  }
  CHECK(number == 12);
  CHECK(run({"lint", "out"}, folder.path()).exit_code == 0);

  const std::string name = "out/hugging/train/metadata.jsonl";
  std::string text = read_file(folder / name);
  text.replace(text.find(R"("frame_index": 3)"), 16, R"("frame_index": 4)");
  write_file(folder / name, text);
  const Outcome lint = run({"lint", "out/hugging"}, folder.path());
  CHECK(lint.exit_code != 0);
  CHECK_THAT(lint.output, ContainsSubstring("its clip, frame and time are 0, 4"));
}

TEST_CASE("Tracking folders of others are read, and what is wrong with them is said", "[run]") {
  const TemporaryFolder folder;
  std::string job = clip_job("{fps: 24, seconds: 0.25}", "6");
  job.insert(job.find("output:"), R"(  - {type: MotWriter, name: mot, val_share: 0}
  - {type: KittiWriter, name: kitti, layout: tracking, val_share: 0}
)");
  write_file(folder / "job.yaml", job);
  REQUIRE(run({"run", "job.yaml"}, folder.path()).exit_code == 0);
  const auto lint = [&](const char* dataset) {
    const Outcome outcome = run({"lint", dataset}, folder.path());
    return std::to_string(outcome.exit_code) + " " + outcome.output;
  };
  // Without our page, and with things that ours does not have.
  fs::create_directories(folder / "theirs/kitti");
  fs::copy(folder / "out/kitti/training", folder / "theirs/kitti/training",
           fs::copy_options::recursive);
  const fs::path labels = folder / "theirs/kitti/training/label_02/0000.txt";
  write_file(labels, "0 -1 DontCare -1 -1 -10 1 2 9 9 -1 -1 -1 -1000 -1000 -1000 -10\n" +
                         read_file(labels));
  CHECK_THAT(lint("theirs/kitti"),
             Catch::Matchers::StartsWith("0 ") && ContainsSubstring("KITTI tracking"));
  fs::remove_all(folder / "theirs/kitti/training/depth_02");
  const Outcome with_six_digits = run({"stats", "theirs/kitti"}, folder.path());
  const std::string ours = "out/mot/train/clip_0000_eyes_0_left/";
  const std::string theirs = "theirs/MOT17/train/MOT17-02/";
  fs::create_directories(folder / theirs);
  fs::copy(folder / (ours + "img1"), folder / (theirs + "img1"), fs::copy_options::recursive);
  const std::string page =
      "[Sequence]\r\nname=MOT17-02\r\nimDir=img1\r\nframeRate=30\r\n"
      "seqLength=6\r\nimWidth=96\r\nimHeight=72\r\nimExt=.png\r\n";
  write_file(folder / (theirs + "seqinfo.ini"), page);
  const fs::path gt = folder / (theirs + "gt/gt.txt");
  write_file(gt,
             "1,1,10.5,20,30,40,1,1,0.5\r\n1,2,-5,3,20,20,0,7,1\n2,1,11.5,20,30.2,40,1,1,0.5\n");
  CHECK_THAT(lint("theirs/MOT17"),
             Catch::Matchers::StartsWith("0 ") && ContainsSubstring("MOT Challenge"));
  const Outcome stats = run({"stats", "theirs/MOT17"}, folder.path());
  CHECK_THAT(stats.output, ContainsSubstring("6 captures") && ContainsSubstring("class 1"));

  write_file(gt, "9,1,1,1,1,1,1,1,1\n1,-3,1,1,1,1,1,1,1\n1,1,1e300,2,3,4,1,1,1\nx,y\n");
  const std::string found = lint("theirs/MOT17");
  CHECK_THAT(found, ContainsSubstring("line 1: is of frame 9; right would be: 1 to 6"));
  CHECK_THAT(found, ContainsSubstring("line 2: its track is -3; right would be: 0 or more"));
  CHECK_THAT(found, ContainsSubstring("line 3: its box is beyond reason"));
  CHECK_THAT(found, ContainsSubstring("line 4 has 2 fields, not 9"));
  // Nothing outside of the sequence is read.
  std::string climbing = page;
  climbing.replace(climbing.find("img1"), 4, "../../../../out/mot");
  write_file(folder / (theirs + "seqinfo.ini"), climbing);
  CHECK_THAT(lint("theirs/MOT17"), ContainsSubstring("imDir is no name"));

  // Pages of a few bytes that ask for a lot of memory.
  const std::string endless = "[Sequence]\nseqLength=9000000\nimExt=.png\n";
  write_file(folder / "theirs/endless/a/seqinfo.ini", endless);
  write_file(folder / "theirs/endless/b/seqinfo.ini", endless);
  const Outcome refused = run({"lint", "theirs/endless"}, folder.path());
  CHECK(refused.exit_code != 0);
  CHECK_THAT(refused.output, ContainsSubstring("more than 10000000 frames in all"));
  // Pictures whose names have other than six digits.
  const fs::path pictures = folder / "theirs/kitti/training/image_02/0000";
  for (int i = 0; i < 6; ++i) {
    const std::string digits = "00000" + std::to_string(i);
    fs::rename(pictures / (digits + ".png"), pictures / ("0000" + digits + ".png"));
  }
  const Outcome tracks = run({"stats", "theirs/kitti"}, folder.path());
  CHECK(tracks.output == with_six_digits.output);
}

TEST_CASE("A video has one sample per frame, where its index says", "[run]") {
  if (!fs::exists(fs::path(DIORAMA_PLUGIN_DIR) / "writer_video.so")) {
    WARN("writer_video is not built: there is no libavcodec");
    return;
  }
  const TemporaryFolder folder;
  std::string job = clip_job();
  job.insert(job.find("output:"),
             "  - {type: VideoWriter, name: video, channels: [color, instance_id]}\n");
  write_file(folder / "job.yaml", job);
  const Outcome outcome = run({"run", "job.yaml"}, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  const std::string video = read_file(folder / "out/video/clip_0001.mp4");
  const auto number = [&](std::size_t at, int bytes) {
    std::size_t value = 0;
    for (int i = 0; i < bytes; ++i) {
      value = value << 8 | static_cast<unsigned char>(video.at(at + std::size_t(i)));
    }
    return value;
  };
  const std::size_t data = number(0, 4);
  CHECK(video.substr(4, 4) == "ftyp");
  CHECK(video.substr(data + 4, 4) == "mdat");
  const std::size_t index = data + number(data + 8, 8);
  CHECK(video.substr(index + 4, 4) == "moov");
  CHECK(index + number(index, 4) == video.size());
  const std::size_t sizes = video.find("stsz", index);
  REQUIRE(number(sizes + 12, 4) == 6);
  std::size_t at = number(video.find("co64", index) + 12, 8);
  CHECK(at == data + 16);
  for (std::size_t i = 0; i < 6; ++i) {
    // Each picture stands alone: units with their lengths in front, one of them a whole picture.
    const std::size_t end = at + number(sizes + 16 + 4 * i, 4);
    bool is_whole = false;
    while (at < end) {
      const std::size_t unit = number(at, 4);
      is_whole |= (number(at + 4, 1) & 31) == 5;
      at += 4 + unit;
    }
    CHECK(at == end);
    CHECK(is_whole);
  }
  CHECK(at == index);
  const std::size_t entry = video.find("avc1", index);
  CHECK(number(entry + 28, 2) == 2 * kWidth);
  CHECK(number(entry + 30, 2) == 2 * kHeight);
}

TEST_CASE("A plan counts the frames of clips, and the last one may be cut short", "[run]") {
  const TemporaryFolder folder;
  write_file(folder / "job.yaml", clip_job("{fps: 24, seconds: 0.25}", "8"));
  const Outcome plan = run({"run", "job.yaml", "--dry-run"}, folder.path());
  CHECK(plan.exit_code == 0);
  CHECK_THAT(plan.output, ContainsSubstring("record clip x 6 at 24/s"));
  CHECK_THAT(plan.output, ContainsSubstring("8 captures x 2 cameras"));
  REQUIRE(run({"run", "job.yaml"}, folder.path()).exit_code == 0);
  const auto files = tree(folder / "out");
  CHECK(Json::parse(files.at("basic/clips.json")).at("clips")[1].at("frame_count") == 2);
  // What is there of it is as in the whole clip, but for where the last frame leads.
  const auto& whole = whole_dataset();
  const std::string name = "basic/rp_eyes_0_left/flow_forward/flow_forward_0006.npy";
  CHECK(files.at(name) == whole.at(name));
}

TEST_CASE("What cannot be recorded is said with its place", "[run]") {
  const TemporaryFolder folder;
  const auto errors_of = [&](std::string job, const std::string& from, const std::string& to) {
    job.replace(job.find(from), from.size(), to);
    write_file(folder / "job.yaml", job);
    const Outcome outcome = run({"run", "job.yaml"}, folder.path());
    CHECK(outcome.exit_code != 0);
    CHECK_FALSE(fs::exists(folder / "out"));
    return outcome.errors;
  };
  const std::string record = "{fps: 24, seconds: 0.25}";
  CHECK_THAT(errors_of(clip_job(), record, "{fps: 1000, seconds: 2000}"),
             ContainsSubstring("timeline[1].record: expected fps x seconds to be at most 1000000 "
                               "frames, found 2000000"));
  CHECK_THAT(errors_of(clip_job(), record, "12"),
             ContainsSubstring("expected a mapping such as {fps: 30, seconds: 2}, found"));
  CHECK_THAT(errors_of(clip_job(), record, "{fps: 0, seconds: 1}"),
             ContainsSubstring("timeline[1].record.fps"));
  CHECK_THAT(errors_of(clip_job(), "{simulate: 14}", "{capture: clip}"),
             ContainsSubstring("'clip' is the name of clips and of another moment"));
  CHECK_THAT(errors_of(clip_job(), "settle:", "views: [{occlusion: {max: 0.5}}]\nsettle:"),
             ContainsSubstring("conditions hold for single captures, and 'clip' is recorded"));
  CHECK_THAT(errors_of(clip_job(), "kind: orbit,", "kind: keys, keys: [{time_s: 1}, {time_s: 1}],"),
             ContainsSubstring("keys[1].time_s: expected more than"));
}
