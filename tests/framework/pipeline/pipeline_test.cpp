// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pipeline.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "diorama/error.h"
#include "diorama/geometry.h"
#include "framework/output/memory_file_system.h"
#include "framework/pipeline/clip_track.h"
#include "framework/plugins/registry.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// What the components of a run do, and what they saw.
struct Script {
  /// Called by each component with its name and the visit that it is at; may throw or wait.
  std::function<void(const std::string& who, int visit)> at = [](const std::string&, int) {};
  /// What the randomizer does to a frame of a clip.
  std::function<void(Scene& scene, const ClipFrame& frame)> play = [](Scene&, const ClipFrame&) {};
  std::function<void(Scene& scene, const ClipFrame& frame)> lead = [](Scene&, const ClipFrame&) {};
  std::function<void(const Scene& scene, double seconds)> carry = [](const Scene&, double) {};
  bool has_bodies = false;  ///< Rooms are rigid bodies.
  std::mutex mutex;
  std::vector<std::string> faults;
  std::map<int, std::set<const void*>> sets;  ///< By visit, the physics that simulated it.
  std::vector<int> encoded;                   ///< Captures in the order of their encoding.
  std::set<std::thread::id> begin_threads;
  std::atomic<int> frames_alive = 0;
  std::atomic<int> most_frames_alive = 0;

  void fault(const std::string& text) {
    const std::lock_guard lock(mutex);
    faults.push_back(text);
  }
};

/// Notes when an instance is called by two threads at once.
class Alone {
 public:
  Alone(std::atomic<bool>& is_busy, Script& script, const char* who) : is_busy_(is_busy) {
    if (is_busy_.exchange(true)) script.fault(std::string(who) + " was called by two threads");
  }
  ~Alone() { is_busy_ = false; }

 private:
  std::atomic<bool>& is_busy_;
};

/// The visit that a scene belongs to, which the loader left in it.
int visit_of(const Scene& scene) {
  const NodeId environment = scene.find("/Environment");
  return environment ? int(scene[scene[environment].children.front()].labels.size()) : -1;
}

class Rooms final : public Loader {
 public:
  explicit Rooms(Script& script) : script_(script) {}
  std::vector<std::string> claims() const override { return {"room:"}; }
  void load(std::string_view asset, Scene& scene, NodeId root) override {
    const Alone alone(is_busy_, script_, "the loader");
    const int visit = std::stoi(std::string(asset.substr(5)));
    script_.at("loader", visit);
    // One label per visit number tells the other components where they are.
    if (script_.has_bodies) scene.edit(root).rigid_body = RigidBody{};
    for (int i = 0; i < visit; ++i) scene.edit(root).labels["room" + std::to_string(i)] = "x";
  }

 private:
  Script& script_;
  std::atomic<bool> is_busy_ = false;
};

class Movers final : public Randomizer {
 public:
  explicit Movers(Script& script) : script_(script) {}
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override {
    const Alone alone(is_busy_, script_, "the randomizer");
    script_.at("randomizer " + context.moment, visit_of(scene));
    // Only what this visit set at its beginning is built upon: an instance is with one visit.
    if (context.moment == "environment") visit_ = visit_of(scene);
    if (visit_ != visit_of(scene)) script_.fault("the randomizer changed visits");
    for (const NodeId camera : scene.match("/Cameras/*")) {
      Rng own = rng.fork(scene[camera].name);
      scene.set_pose(camera, Transform{{own.uniform(-1, 1), own.uniform(-1, 1), 2.0}});
    }
  }
  void play(Scene& scene, const ClipFrame& frame) override { script_.play(scene, frame); }
  void lead(Scene& scene, const ClipFrame& frame) override { script_.lead(scene, frame); }

 private:
  Script& script_;
  std::atomic<bool> is_busy_ = false;
  int visit_ = -1;
};

class Pusher final : public PhysicsBackend {
 public:
  explicit Pusher(Script& script) : script_(script) {}
  double step_seconds() const override { return 1.0 / 60.0; }
  PhysicsReport report() const override { return {}; }

 private:
  void do_reset(const Scene& scene) override {
    const Alone alone(is_busy_, script_, "the physics");
    visit_ = visit_of(scene);
    taken_ = 0;
    const std::lock_guard lock(script_.mutex);
    script_.sets[visit_].insert(this);
  }
  void do_advance(int steps) override {
    const Alone alone(is_busy_, script_, "the physics");
    taken_ += steps;
    script_.at("physics", visit_);
  }
  void do_carry(const Scene& scene, double seconds) override { script_.carry(scene, seconds); }
  void do_write_poses(Scene& scene) const override {
    if (visit_of(scene) != visit_) script_.fault("the physics changed visits");
    scene.set_pose(scene.require("/Lights/lamp_0"), Transform{{0.0, 0.0, double(taken_)}});
  }

  Script& script_;
  std::atomic<bool> is_busy_ = false;
  int visit_ = -1;
  int taken_ = 0;
};

class Painter final : public Renderer {
 public:
  Painter(Script& script, Host& host) : script_(script), host_(host) {}
  NameSet provides() const override { return {std::string(kColor.name)}; }

 private:
  void do_prepare(const Scene& scene) override {
    const Alone alone(is_busy_, script_, "the renderer");
    script_.at("prepare", visit_of(scene));
  }
  Frame do_render(const Scene& scene, const RenderRequest& request) override {
    const Alone alone(is_busy_, script_, "the renderer");
    script_.at("render", visit_of(scene));
    script_.most_frames_alive = std::max(script_.most_frames_alive.load(), ++script_.frames_alive);
    Frame frame;
    frame.camera = *scene[request.camera].camera;
    frame.camera_name = scene[request.camera].name;
    frame.camera_path = scene.path(request.camera);
    frame.world_from_camera = scene.world_from_node(request.camera);
    Image<Rgba8> image(frame.camera.width, frame.camera.height, Rgba8{});
    const double depth = scene.world_from_node(scene.require("/Lights/lamp_0")).translation().z();
    const auto rows = std::size_t(image.height());
    host_.parallel_for(rows, [&](std::size_t y) {
      Rng rng = Rng(request.seed).fork(std::uint64_t(y));
      for (int x = 0; x < image.width(); ++x) {
        const auto value = std::uint8_t(rng.index(250));
        image.at(x, int(y)) =
            Rgba8{value, std::uint8_t(int(depth) % 256), std::uint8_t(visit_of(scene)), 255};
      }
    });
    frame.set(kColor, std::move(image));
    return frame;
  }
  std::vector<CoverageMask> do_cover(const Scene&, NodeId, std::span<const LabelledInstance> what,
                                     bool) override {
    return std::vector<CoverageMask>(what.size());
  }

  Script& script_;
  Host& host_;
  std::atomic<bool> is_busy_ = false;
};

class Pictures final : public Writer {
 public:
  explicit Pictures(Script& script) : script_(script) {}
  NameSet needs() const override { return {std::string(kColor.name)}; }
  void begin(const DatasetInfo&, DatasetFiles& files) override {
    const std::lock_guard lock(script_.mutex);
    script_.begin_threads.insert(std::this_thread::get_id());
    files.add_text("begin.txt", "begun");
  }
  void write(const Capture& capture, CaptureFiles& files) const override {
    {
      const std::lock_guard lock(script_.mutex);
      script_.encoded.push_back(capture.index);
    }
    script_.at("writer", capture.visit);
    std::string text = capture.phase + " of " + capture.environment + "\n";
    for (const Frame& frame : capture.frames) {
      const Vec3 place = frame.world_from_camera.translation();
      const Vec3& velocity = frame.camera.linear_velocity;
      text += std::to_string(place.x()) + " at " + std::to_string(velocity.x()) + " m/s, turning " +
              std::to_string(frame.camera.angular_velocity.z()) + "\n";
      const auto pixels = frame.get(kColor).pixels();
      text.append(reinterpret_cast<const char*>(pixels.data()), pixels.size_bytes());
    }
    files.add_text("capture_" + std::to_string(capture.index) + ".bin", text);
    files.record("capture " + std::to_string(capture.index));
    script_.frames_alive -= int(capture.frames.size());
  }
  void finish(const RecordReader& records, DatasetFiles& files) override {
    std::string text;
    records([&](int, std::string_view line) { text += std::string(line) + "\n"; });
    files.add_text("finish.txt", text);
  }

 private:
  Script& script_;
};

const char* const kJob = R"(seed: 8
total_captures: 23
environments: [{type: rooms}]
lights: [{type: sphere, name: lamp, radius_m: 0.1}]
cameras: [{type: pinhole, name: cam, count: 2, width: 24, height: 16}]
randomizers: [{type: movers, name: poses, on: [environment, early, late]}]
physics: {type: pusher}
renderer: {type: painter}
timeline: [{simulate: 4}, {capture: early, count: 2}, {simulate: 20}, {capture: late, count: 1}]
settle: {policy: keep}
writers: [{type: pictures, name: pictures}]
output: {folder: /out}
)";
constexpr int kVisits = 8;  // the last with two captures

const char* const kClipJob = R"(seed: 8
total_captures: 12
environments: [{type: rooms}]
lights: [{type: sphere, name: lamp, radius_m: 0.1}]
cameras:
  - {type: pinhole, name: cam, count: 2, width: 24, height: 16, exposure_time_s: 0.02}
randomizers: [{type: movers, name: poses, on: [environment, clip, late]}]
physics: {type: pusher}
renderer: {type: painter}
timeline: [{record: {fps: 10, seconds: 0.4}}, {simulate: 2}, {capture: late, count: 1}]
settle: {policy: keep}
writers: [{type: pictures, name: pictures}]
output: {folder: /out}
)";

/// The first camera goes along x, ever faster, and turns; each step depends on the one before.
void go_along(Scene& scene, const ClipFrame& frame) {
  const NodeId camera = scene.require("/Cameras/cam_0");
  const double x = scene.world_from_node(camera).translation().x();
  Affine pose = Affine::Identity();
  pose.translation() = Vec3(frame.frame == 0 ? 0.0 : x + 0.1 * frame.frame, 0, 2);
  pose.linear() = Eigen::AngleAxisd(0.2 * frame.frame, Vec3::UnitZ()).toRotationMatrix();
  scene.set_pose(camera, pose);
}

struct Run {
  explicit Run(Script& with, int visits_in_flight = 1, int threads = 1, const char* text = kJob)
      : script(with), host(registry, host_options(threads), [](LogLevel, std::string_view) {}) {
    job = job_from(text);
    std::vector<EnvironmentChoice> environments;
    for (int i = 0; i < kVisits; ++i) environments.push_back({"room:" + std::to_string(i), 0});
    plan = plan_captures(job, environments, {});
    for (int i = 0; i < visits_in_flight; ++i) {
      VisitComponents set;
      set.environments.push_back(std::make_unique<Rooms>(script));
      set.physics = std::make_unique<Pusher>(script);
      set.renderer = std::make_unique<Painter>(script, host);
      set.randomizers.push_back(std::make_unique<Movers>(script));
      components.sets.push_back(std::move(set));
    }
    components.writers.push_back(std::make_unique<Pictures>(script));
    components.demand.channels = {std::string(kColor.name)};
    host.stop_on(stop);
    options.stop = &stop;
    options.progress = [this](const RunProgress& now) {
      if (std::this_thread::get_id() != main_thread) script.fault("progress by another thread");
      if (now.done < progress.done) script.fault("progress goes back");
      if (now.done > int(captures().size())) script.fault("what is not on disk is called done");
      progress = now;
    };
  }

  RunSummary go() {
    DatasetInfo dataset;
    dataset.capture_count = plan.capture_count();
    dataset.camera_names = {"cam_0", "cam_1"};
    OutputFolders folders;
    folders.base = "/out";
    folders.records = ".";
    folders.writers = {{"pictures", "pictures"}};
    OutputStore::Options store_options;
    store_options.existing = OutputStore::Existing::Resume;
    store_options.takes_visits = options.takes_visits;
    OutputStore store(disk, folders, plan.capture_count(), store_options);
    Pipeline pipeline(job, plan, components, host, store, options);
    return pipeline.run(dataset, R"({"job": "of the test"})");
  }

  /// Files of the writers and what a run says of visits, by path.
  std::map<std::string, std::string> files() {
    std::map<std::string, std::string> found;
    const auto look = [&](const auto& self, const std::filesystem::path& folder) -> void {
      if (folder.filename() == ".diorama" || !disk.status(folder)) return;
      for (const std::string& name : disk.list(folder)) {
        const auto path = folder / name;
        const auto status = disk.status(path);
        if (status && status->kind == FileStatus::Kind::Folder) {
          self(self, path);
        } else {
          found[path.string()] = disk.read(path);
        }
      }
    };
    look(look, "/out");
    return found;
  }
  std::set<int> captures() {
    std::set<int> made;
    for (int i = 0; i < plan.capture_count(); ++i) {
      const std::string name = "/out/pictures/capture_" + std::to_string(i) + ".bin";
      if (disk.status(name)) made.insert(i);
    }
    return made;
  }

  static HostOptions host_options(int threads) {
    HostOptions options;
    options.threads = threads;
    return options;
  }

  Script& script;
  Registry registry{{}, [](LogLevel, std::string_view) {}};
  HostServices host;
  Job job;
  CapturePlan plan;
  JobComponents components;
  MemoryFileSystem disk;
  std::atomic<bool> stop = false;
  RunOptions options;
  RunProgress progress;
  std::thread::id main_thread = std::this_thread::get_id();
};

std::set<int> first_captures(int count) {
  std::set<int> all;
  for (int i = 0; i < count; ++i) all.insert(i);
  return all;
}

void pause(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

/// Early visits are slow, so that later ones are done before them.
void dawdle(const std::string& who, int visit) {
  if (who == "physics") pause(visit % 3 == 0 ? 2 : 0);
  if (who == "writer") pause(visit % 4 == 1 ? 1 : 0);
}

}  // namespace

TEST_CASE("Visits in flight and threads leave no trace in the dataset", "[pipeline]") {
  Script first;
  Run serial(first);
  const RunSummary expected = serial.go();
  REQUIRE(serial.captures() == first_captures(23));
  CHECK(expected.is_finished);
  CHECK(serial.files().contains("/out/pictures/finish.txt"));
  for (const int visits : {1, 2, 4, 9}) {
    for (const int threads : {1, 2, 4}) {
      CAPTURE(visits, threads);
      Script script;
      script.at = dawdle;
      Run run(script, visits, threads);
      const RunSummary summary = run.go();
      CHECK(run.files() == serial.files());
      CHECK(summary.captures == 23);
      CHECK(run.progress.done == 23);
      CHECK(summary.settled.visit_count() == expected.settled.visit_count());
      CHECK(summary.settled.text() == expected.settled.text());
      CHECK(script.begin_threads == std::set<std::thread::id>{std::this_thread::get_id()});
      for (const auto& [visit, sets] : script.sets) CHECK(sets.size() == 1);
      CHECK(script.faults == std::vector<std::string>());
    }
  }
}

TEST_CASE("While a visit is rendered the next one is loaded and simulated", "[pipeline]") {
  // The first picture waits until another visit was simulated, for which there is all the time.
  Script script;
  std::mutex mutex;
  std::condition_variable changed;
  bool is_simulated = false;
  bool was_met = true;
  script.at = [&](const std::string& who, int visit) {
    std::unique_lock lock(mutex);
    if (who == "physics" && visit == 1) is_simulated = true;
    changed.notify_all();
    if (who != "render" || visit != 0) return;
    was_met = changed.wait_for(lock, std::chrono::seconds(60), [&] { return is_simulated; });
  };
  Run run(script, 2, 2);
  run.go();
  CHECK(was_met);
  CHECK(run.captures() == first_captures(23));
}

TEST_CASE("What fails first in order is reported, and nothing behind it is published",
          "[pipeline]") {
  // Visit 3 fails after its two early captures; later ones fail sooner by the clock.
  for (const int visits : {1, 2, 4, 8}) {
    for (const int threads : {1, 4}) {
      CAPTURE(visits, threads);
      Script script;
      std::atomic<int> pushed = 0;
      script.at = [&](const std::string& who, int visit) {
        dawdle(who, visit);
        if (who == "physics" && visit == 3 && ++pushed > 2) {
          pause(5);
          throw Error(ErrorKind::Asset, "a thing of visit 3 exploded");
        }
        if (who == "loader" && visit > 3) throw Error(ErrorKind::Asset, "no such room");
      };
      Run run(script, visits, threads);
      CHECK_THROWS_WITH(run.go(), "physics 'pusher': a thing of visit 3 exploded");
      CHECK(run.captures() == first_captures(11));
      CHECK_FALSE(run.files().contains("/out/pictures/finish.txt"));
      CHECK(script.faults == std::vector<std::string>());
    }
  }
}

TEST_CASE("A run whose first visit cannot be made leaves nothing", "[pipeline]") {
  for (const int visits : {1, 4}) {
    Script script;
    script.at = [](const std::string& who, int visit) {
      if (who != "loader" || visit != 0) return;
      pause(20);
      throw Error(ErrorKind::Asset, "no such room");
    };
    Run run(script, visits, 4);
    CHECK_THROWS_WITH(run.go(), ContainsSubstring("no such room"));
    CHECK(script.begin_threads.empty());
    CHECK(script.encoded.empty());
    CHECK(run.files().empty());
  }
}

TEST_CASE("An error in writing is reported before those of later visits", "[pipeline]") {
  Script script;
  script.at = [](const std::string& who, int visit) {
    if (who == "writer" && visit == 1) throw Error(ErrorKind::Output, "the disk is full");
    if (who == "physics" && visit == 7) throw Error(ErrorKind::Asset, "too late");
  };
  Run run(script, 8, 4);
  CHECK_THROWS_WITH(run.go(), "writer 'pictures': the disk is full");
  for (const int capture : run.captures()) CHECK(capture < 3);
}

TEST_CASE("A run that is stopped with visits in flight can be resumed", "[pipeline]") {
  Script calm;
  Run whole(calm);
  whole.go();
  for (const int visits : {1, 2, 4}) {
    CAPTURE(visits);
    Script script;
    std::atomic<bool>* stop = nullptr;
    std::atomic<int> renders = 0;
    script.at = [&](const std::string& who, int visit) {
      dawdle(who, visit);
      if (who == "render" && ++renders == 17) *stop = true;
    };
    Run run(script, visits, 2);
    stop = &run.stop;
    CHECK_THROWS_AS(run.go(), Interrupted);
    const std::set<int> before = run.captures();
    CHECK(before.size() < 23);
    run.stop = false;
    run.progress = {};
    const RunSummary summary = run.go();
    CHECK(summary.resumed == int(before.size()));
    CHECK(run.files() == whole.files());
    CHECK(script.faults == std::vector<std::string>());
  }
}

TEST_CASE("A worker that takes visits makes all of them, several at a time", "[pipeline]") {
  Script calm;
  Run whole(calm);
  whole.go();
  Script script;
  script.at = dawdle;
  Run run(script, 3, 2);
  run.options.takes_visits = true;
  CHECK(run.go().is_finished);
  CHECK(run.files() == whole.files());
}

TEST_CASE("Memory for captures is bounded while a slow visit holds up all later ones",
          "[pipeline]") {
  Script script;
  std::atomic<int> writes = 0;
  script.at = [&](const std::string& who, int visit) {
    if (who == "physics" && visit == 0) pause(40);
    if (who == "writer") ++writes;
  };
  Run run(script, 4, 4);
  run.options.queue_bytes = 1;  // one capture of the visit whose turn it is
  run.options.encodes_in_order = true;
  run.go();
  CHECK(run.captures() == first_captures(23));
  // Each visit has one in its hands, the queue one more; a capture has two frames.
  CHECK(script.most_frames_alive <= 2 * (4 + 1));
}

TEST_CASE("Visits run ahead of a slow one only so far", "[pipeline]") {
  Script script;
  std::atomic<int> renders = 0;
  std::atomic<int> begun_early = 0;
  script.at = [&](const std::string& who, int visit) {
    // Visit 0 ends after its six pictures, and is slow once its first capture has been written:
    // before, nobody else may write. Two at a time, and eight times as many are begun.
    if (who == "render" && visit == 0 && ++renders == 4) pause(700);
    if (who == "loader" && visit >= 16 && renders < 6) ++begun_early;
  };
  Run run(script, 2, 2);
  run.job.total_captures = 120;
  std::vector<EnvironmentChoice> environments;
  for (int i = 0; i < 20; ++i) environments.push_back({"room:" + std::to_string(i), 0});
  run.plan = plan_captures(run.job, environments, {});
  run.go();
  CHECK(begun_early == 0);
  CHECK(run.captures() == first_captures(120));
}

TEST_CASE("Writers that want it get captures in their order", "[pipeline]") {
  for (const int threads : {1, 4}) {
    Script script;
    script.at = dawdle;
    Run run(script, 4, threads);
    run.options.encodes_in_order = true;
    run.go();
    CHECK(script.encoded.size() == 23);
    if (threads == 1) CHECK(std::ranges::is_sorted(script.encoded));
    // A thread may be held up over its capture while the others go on, for as long as it takes, but
    // every capture that has been passed over is in the hands of a thread of its own.
    for (std::size_t i = 0; i < script.encoded.size(); ++i) {
      CHECK(script.encoded[i] - int(i) < threads);
    }
  }
}

TEST_CASE("A clip that is broken off anywhere goes on as it would have gone", "[pipeline]") {
  Script script;
  script.play = go_along;
  Run whole(script, 1, 1, kClipJob);
  whole.go();
  const auto expected = whole.files();
  REQUIRE(whole.captures() == first_captures(12));
  for (int made = 1; made < 12; ++made) {
    CAPTURE(made);
    Run part(script, 1, 1, kClipJob);
    part.options.only = first_captures(made);
    part.go();
    REQUIRE(part.captures() == first_captures(made));
    part.options.only.reset();
    part.go();
    CHECK(part.files() == expected);
  }
}

TEST_CASE("Cameras with open shutters move as their clips do", "[pipeline]") {
  Script script;
  script.play = go_along;
  Run run(script, 1, 1, kClipJob);
  run.go();
  const auto files = run.files();
  const auto line = [&](int capture, std::size_t camera) {
    const std::string& text = files.at("/out/pictures/capture_" + std::to_string(capture) + ".bin");
    const std::size_t start = text.find('\n') + 1;
    if (camera == 0) return text.substr(start, text.find('\n', start) - start);
    const std::size_t end = text.rfind(" at ");
    return text.substr(end, text.find('\n', end) - end);
  };
  // 0, 0.1, 0.3, 0.6 m, ten frames a second; by the frames beside each, as far as there are some.
  CHECK(line(0, 0) == "0.000000 at 1.000000 m/s, turning 2.000000");
  CHECK(line(1, 0) == "0.100000 at 1.500000 m/s, turning 2.000000");
  CHECK(line(2, 0) == "0.300000 at 2.500000 m/s, turning 2.000000");
  CHECK(line(3, 0) == "0.600000 at 3.000000 m/s, turning 2.000000");
  // What stands still does not, nor does a capture that stands alone.
  CHECK(line(2, 1) == " at 0.000000 m/s, turning 0.000000");
  CHECK_THAT(line(4, 0), ContainsSubstring(" at 0.000000 m/s, turning 0.000000"));
}

TEST_CASE("A clip that the job's end cuts short begins as the whole one", "[pipeline]") {
  Script script;
  script.play = go_along;
  Run whole(script, 1, 1, kClipJob);
  whole.go();
  Run cut(script, 1, 1, kClipJob);
  cut.job.total_captures = 7;
  cut.plan = plan_captures(cut.job, whole.plan.environments, {});
  cut.go();
  const auto expected = whole.files();
  const auto files = cut.files();
  int same = 0;
  bool has_first = false;
  for (const auto& [name, text] : files) {
    if (name.find("capture_") != std::string::npos) {
      CHECK(text == expected.at(name));
      ++same;
    }
    // It ends with things in the air, which is nothing to report.
    CHECK(name.find("settle/1_") == std::string::npos);
    has_first |= name.find("settle/0_") != std::string::npos;
  }
  CHECK(same == 7);
  CHECK(has_first);
}

TEST_CASE("Who leads a clip does so before physics goes on to a frame", "[pipeline]") {
  Script script;
  std::string told;
  const auto height = [](const Scene& scene) {
    return std::to_string(int(scene[scene.require("/Environment")].parent_from_node(2, 3)));
  };
  script.lead = [&](Scene& scene, const ClipFrame& frame) {
    scene.set_pose(scene.require("/Environment"), Transform{{0, 0, double(frame.frame)}});
    told += " lead " + std::to_string(frame.frame);
  };
  script.carry = [&](const Scene& scene, double seconds) {
    CHECK(seconds == Approx(0.1));
    told += " carry " + height(scene);
  };
  script.play = [&](Scene& scene, const ClipFrame& frame) {
    told += " play " + std::to_string(frame.frame) + " " + height(scene);
  };
  Run run(script, 1, 1, kClipJob);
  run.options.only = first_captures(4);
  run.go();
  CHECK_THAT(told, ContainsSubstring(" play 0 0 lead 1 carry 1 play 1 1 lead 2 carry 2 play 2 2"));
  script.has_bodies = true;
  Run with_body(script, 1, 1, kClipJob);
  CHECK_THROWS_WITH(with_body.go(), ContainsSubstring("moves rigid bodies while a clip plays"));
}

TEST_CASE("Who plays a clip may move neither bodies nor shapes", "[pipeline]") {
  Script script;
  Run run(script, 1, 1, kClipJob);
  script.play = [](Scene& scene, const ClipFrame& frame) {
    if (frame.frame == 2) scene.set_pose(scene.require("/Environment"), Transform{{0, 0, 1}});
  };
  CHECK_NOTHROW(run.go());
  script.has_bodies = true;
  Run with_body(script, 1, 1, kClipJob);
  CHECK_THROWS_WITH(with_body.go(), ContainsSubstring("moves rigid bodies while a clip plays"));
  script.play = [](Scene& scene, const ClipFrame& frame) {
    if (frame.frame == 1) scene.create(scene.root(), "more");
  };
  Run with_more(script, 1, 1, kClipJob);
  CHECK_THROWS_WITH(with_more.go(), ContainsSubstring("changes more than poses and meshes"));
  script.has_bodies = false;
  script.play = [](Scene& scene, const ClipFrame& frame) {
    if (frame.frame == 1) scene.edit(scene.require("/Environment")).labels["mood"] = "gloomy";
  };
  Run with_label(script, 1, 1, kClipJob);
  CHECK_THROWS_WITH(with_label.go(), ContainsSubstring("changes more than poses and meshes"));
}

TEST_CASE("A clip's track shows meshes as they were in each frame", "[pipeline]") {
  Scene scene;
  const NodeId flag = scene.create(scene.root(), "flag");
  const NodeId pole = scene.create(scene.root(), "pole");
  const auto box = [](double size) {
    return std::make_shared<const Mesh>(make_box(Vec3::Constant(size)));
  };
  const std::vector<std::shared_ptr<const Mesh>> frames{box(1), box(2), box(3), box(4)};
  scene.edit(pole).mesh = box(9);
  const auto stands = scene[pole].mesh;
  ClipTrack track;
  PlayWatch watch(scene);
  for (const auto& mesh : frames) {
    watch.begin_frame(scene);
    scene.edit(flag).mesh = mesh;
    if (track.size() == 0) {
      // It had none before.
      CHECK_THROWS_WITH(watch.check(scene), ContainsSubstring("more than poses and meshes"));
      watch = PlayWatch(scene);
    }
    CHECK_NOTHROW(watch.check(scene));
    track.add(scene);
  }
  for (const int frame : {1, 3, 2}) {
    track.show(frame, scene);
    CHECK(scene[flag].mesh == frames[std::size_t(frame)]);
    CHECK(track.mesh(flag, frame) == frames[std::size_t(frame)]);
    CHECK(scene[pole].mesh == stands);
  }
  // What is shown already is not touched.
  const std::uint64_t shapes = scene.shape_revision();
  track.show(2, scene);
  CHECK(scene.shape_revision() == shapes);
}
