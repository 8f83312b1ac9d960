// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pipeline.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <set>

#include "diorama/error.h"
#include "framework/annotators/motion.h"
#include "framework/annotators/visibility.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {

/// Adds the time until its end to a phase.
class Pipeline::Clock {
 public:
  Clock(RunSummary& summary, const char* phase)
      : seconds_(summary.seconds[phase]), start_(std::chrono::steady_clock::now()) {}
  ~Clock() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_;
};

/// The scene of one visit and what the pipeline knows about it.
struct Pipeline::Visit {
  const PlannedVisit* planned = nullptr;
  Scene scene;
  NodeId environment;
  Vec3 working_area_world = Vec3::Zero();
  std::vector<NodeId> objects;
  std::vector<NodeId> cameras;
  BodyPoses before_last_step;  ///< Empty when nothing moved by itself since it was placed.
  NodeId overview;             ///< Null unless this visit makes an overview picture.
  std::size_t next_capture = 0;
  std::map<std::string, int> events;
};

namespace {

std::vector<Mat4> object_poses(const Scene& scene, const std::vector<NodeId>& objects) {
  std::vector<Mat4> poses;
  poses.reserve(objects.size());
  for (const NodeId object : objects) poses.push_back(scene.world_from_node(object).matrix());
  return poses;
}

bool acts_at(const RandomizerEntry& entry, const std::string& moment, int number) {
  return number % entry.every == 0 &&
         std::find(entry.on.begin(), entry.on.end(), moment) != entry.on.end();
}

std::string duration_text(double seconds) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f s", seconds);
  return text;
}

}  // namespace

Interrupted::~Interrupted() = default;

Pipeline::Pipeline(const Job& job, const CapturePlan& plan, JobComponents& components, Host& host,
                   OutputStore& store, RunOptions options)
    : job_(job),
      plan_(plan),
      components_(components),
      host_(host),
      store_(store),
      options_(std::move(options)),
      streams_(job.seed),
      visits_(shard_of(plan, options_.shard, options_.shards)) {}

Pipeline::~Pipeline() = default;

RunSummary Pipeline::run(const DatasetInfo& dataset, const std::string& dataset_json) {
  dataset_ = &dataset;
  dataset_json_ = &dataset_json;
  summary_.cameras = int(dataset.camera_names.size());
  store_.check(dataset_json, options_.existing);
  for (const PlannedVisit& visit : visits_) {
    total_ += int(visit.captures.size());
    for (const PlannedCapture& capture : visit.captures) {
      const bool is_kept = options_.existing == OutputStore::Existing::Resume;
      summary_.resumed += is_kept && store_.is_done(capture.index) ? 1 : 0;
    }
  }
  const int writing_threads = std::clamp(host_.thread_count(), 1, 4);
  queue_ = std::make_unique<WriterQueue>(writing_threads, options_.queue_bytes,
                                         [this](const PendingCapture& pending) { write(pending); });
  try {
    for (const PlannedVisit& visit : visits_) {
      if (is_needed(visit)) run_visit(visit);
    }
  } catch (const Interrupted&) {
    queue_->drain();
    store_.close();
    throw;
  }
  {
    const Clock clock(summary_, "waiting for writers");
    queue_->drain();
  }
  begin_output();
  finish_output(dataset);
  store_.close();
  summary_.bytes_written = store_.bytes_written();
  return std::move(summary_);
}

bool Pipeline::is_needed(const PlannedVisit& planned) const {
  if (options_.existing != OutputStore::Existing::Resume) return true;
  return std::any_of(planned.captures.begin(), planned.captures.end(),
                     [&](const PlannedCapture& c) { return !store_.is_done(c.index); });
}

void Pipeline::stop_if_asked() const {
  if (options_.stop && *options_.stop) throw Interrupted();
}

void Pipeline::run_visit(const PlannedVisit& planned) {
  Visit visit = set_up(planned);
  randomize(visit, "environment", 0, -1);
  for (auto& physics : components_.physics) physics->reset(visit.scene);
  for (const TimelineStep& step : job_.timeline) {
    if (visit.next_capture == planned.captures.size()) {
      // What comes after the last capture is left out; then the objects may still be in the air.
      if (step.kind == TimelineStep::Kind::Simulate) return;
      continue;
    }
    switch (step.kind) {
      case TimelineStep::Kind::Simulate:
        simulate(visit, step.steps);
        break;
      case TimelineStep::Kind::Capture:
        take_captures(visit, step);
        break;
      case TimelineStep::Kind::Event:
        randomize(visit, step.name, visit.events[step.name]++, -1);
        break;
    }
  }
  summary_.visits.push_back(report_on(visit));
}

Pipeline::Visit Pipeline::set_up(const PlannedVisit& planned) {
  const Clock clock(summary_, "loading");
  stop_if_asked();
  const EnvironmentChoice& choice = plan_.environments[planned.environment];
  host_.log(LogLevel::Info, "visit " + std::to_string(planned.index + 1) + " of " +
                                std::to_string(plan_.visits.size()) + ": " + choice.asset);
  Visit visit;
  visit.planned = &planned;
  visit.environment = load_environment(choice.asset, job_.environments[choice.entry],
                                       *components_.environments[choice.entry], visit.scene, host_);
  visit.working_area_world =
      apply_environment_rules(job_.environment, job_.debug, visit.environment, visit.scene, host_);
  visit.objects = spawn_objects(plan_, job_, visit.scene, host_);
  create_lights(job_.lights, visit.scene, host_);
  visit.cameras = create_cameras(job_.cameras, visit.scene);
  // The first visit of each environment shows it from above.
  if (job_.debug && std::size_t(planned.index) == planned.environment) {
    visit.overview = create_overview_camera(visit.working_area_world, visit.scene);
  }
  return visit;
}

void Pipeline::randomize(Visit& visit, const std::string& moment, int number, int capture) {
  const Clock clock(summary_, "randomizing");
  const std::vector<Mat4> before = object_poses(visit.scene, visit.objects);
  RandomizeContext context;
  context.moment = moment;
  context.capture = capture;
  context.working_area_world = visit.working_area_world;
  for (std::size_t i = 0; i < job_.randomizers.size(); ++i) {
    const RandomizerEntry& entry = job_.randomizers[i];
    if (!acts_at(entry, moment, number)) continue;
    const Rng rng = streams_.randomizer(entry.name, visit.planned->index, moment,
                                        capture >= 0 ? capture : number);
    call_component("randomizer '" + entry.name + "'",
                   [&] { components_.randomizers[i]->randomize(visit.scene, context, rng); });
  }
  // The engine holds the bodies where it left them; where they were moved, it starts anew.
  if (moment == "environment" || object_poses(visit.scene, visit.objects) == before) return;
  visit.before_last_step.clear();
  for (auto& physics : components_.physics) physics->reset(visit.scene);
}

void Pipeline::simulate(Visit& visit, int steps) {
  const Clock clock(summary_, "simulating");
  // Short enough that Ctrl-C is felt.
  constexpr int kStepsAtOnce = 20;
  for (int left = steps; left > 0;) {
    stop_if_asked();
    // The last step goes by itself: what it moves is the motion that captures show.
    const int now = left == 1 ? 1 : std::min(kStepsAtOnce, left - 1);
    if (left == 1 && components_.demand.motion) visit.before_last_step = body_poses(visit.scene);
    for (auto& physics : components_.physics) {
      call_component("physics '" + job_.physics.type + "'",
                     [&] { physics->advance(visit.scene, now); });
    }
    left -= now;
  }
}

void Pipeline::take_captures(Visit& visit, const TimelineStep& step) {
  for (int i = 0; i < step.count; ++i) {
    if (visit.next_capture == visit.planned->captures.size()) return;
    const PlannedCapture& planned = visit.planned->captures[visit.next_capture++];
    randomize(visit, planned.phase, planned.number, planned.index);
    const bool is_done =
        options_.existing == OutputStore::Existing::Resume && store_.is_done(planned.index);
    if (!is_done) take(visit, planned);
  }
}

void Pipeline::take(Visit& visit, const PlannedCapture& planned) {
  stop_if_asked();
  begin_output();
  PendingCapture pending;
  Capture& capture = pending.capture;
  capture.index = planned.index;
  capture.visit = visit.planned->index;
  capture.phase = planned.phase;
  capture.environment = plan_.environments[visit.planned->environment].asset;
  {
    const Clock clock(summary_, "preparing renderer");
    call_component("renderer '" + job_.renderer.type + "'",
                   [&] { components_.renderer->prepare(visit.scene); });
  }
  for (std::size_t i = 0; i < visit.cameras.size(); ++i) {
    stop_if_asked();
    capture.frames.push_back(make_frame(visit, i, planned.index));
  }
  if (visit.overview && visit.next_capture == 1) {
    pending.overview = make_overview(visit, planned.index);
  }
  {
    const Clock clock(summary_, "waiting for writers");
    queue_->push(std::move(pending));
  }
  ++summary_.captures;
  if (options_.progress) {
    options_.progress(summary_.resumed + summary_.captures, total_, summary_.resumed);
  }
}

Frame Pipeline::make_frame(Visit& visit, std::size_t camera, int capture) {
  const NodeId node = visit.cameras[camera];
  const std::string who = "renderer '" + job_.renderer.type + "'";
  RenderRequest request;
  request.camera = node;
  request.channels = components_.demand.channels;
  request.seed = streams_.render_seed(capture, visit.scene[node].name);
  Frame frame;
  {
    const Clock clock(summary_, "rendering");
    frame = call_component(who, [&] { return components_.renderer->render(request); });
  }
  const Clock clock(summary_, "annotating");
  for (const auto& annotator : components_.annotators) {
    call_component("annotator", [&] { annotator->annotate(visit.scene, frame); });
  }
  if (components_.demand.visibility) {
    const auto instances = labelled_instances(visit.scene);
    const auto coverage =
        call_component(who, [&] { return components_.renderer->cover(node, instances); });
    measure_visibility(coverage, components_.demand.amodal_mask, frame);
  }
  if (components_.demand.motion) measure_motion(visit.scene, visit.before_last_step, frame);
  return frame;
}

Image<Rgba8> Pipeline::make_overview(Visit& visit, int capture) {
  const Clock clock(summary_, "rendering");
  if (!components_.renderer->provides().contains(kColor.name)) return {};
  RenderRequest request;
  request.camera = visit.overview;
  request.channels = {std::string(kColor.name)};
  request.seed = streams_.render_seed(capture, "overview");
  return call_component("renderer '" + job_.renderer.type + "'",
                        [&] { return components_.renderer->render(request).get(kColor); });
}

VisitReport Pipeline::report_on(const Visit& visit) const {
  VisitReport report;
  report.visit = visit.planned->index;
  for (const auto& physics : components_.physics) {
    const PhysicsReport state = physics->report();
    report.max_penetration_m = state.max_penetration_m;
    report.deepest_body = state.deepest_body;
  }
  Aabb room = visit.scene.world_bounds(visit.environment);
  if (room.is_empty()) return report;
  // Things lie on the outer face of the floor's slab at worst; a scene without a roof is open
  // above.
  constexpr double kMarginM = 0.01;
  room.min.array() -= kMarginM;
  room.max.array() += kMarginM;
  room.max.z() = kInfinity;
  for (const NodeId object : visit.objects) {
    const Vec3 place = visit.scene.world_from_node(object).translation();
    const bool is_inside =
        (place.array() >= room.min.array()).all() && (place.array() <= room.max.array()).all();
    const auto& body = visit.scene[object].rigid_body;
    const bool falls = body && body->has_gravity;
    if (falls) ++report.falling_objects;
    // What has left falls for ever and says nothing about the rest.
    if (!is_inside) report.left_room.push_back(visit.scene.path(object));
    if (is_inside && falls) {
      report.max_speed = std::max(report.max_speed, body->linear_velocity.norm());
    }
  }
  return report;
}

void Pipeline::begin_output() {
  if (has_begun_) return;
  has_begun_ = true;
  std::set<int> own;
  for (const PlannedVisit& visit : visits_) {
    for (const PlannedCapture& capture : visit.captures) own.insert(capture.index);
  }
  store_.open(options_.existing, own);
  Transaction transaction;
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->begin(*dataset_, files); });
  }
  const auto text = std::as_bytes(std::span(*dataset_json_));
  transaction.files.push_back({kRecordsFolder, "dataset.json", {text.begin(), text.end()}});
  store_.commit_begin(transaction, options_.shard);
}

void Pipeline::write(const PendingCapture& pending) {
  Transaction transaction;
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->write(pending.capture, files); });
  }
  if (const auto& overview = pending.overview; overview.width() > 0) {
    const ImageView view{overview.pixels().data(), overview.width(), overview.height(), 4, 8};
    transaction.files.push_back({kRecordsFolder,
                                 "overview/" + std::to_string(pending.capture.visit) + "_" +
                                     node_name(asset_stem(pending.capture.environment)) + ".png",
                                 host_.encode_image(view, ImageFormat::Png)});
  }
  store_.commit_capture(pending.capture.index, transaction);
}

void Pipeline::finish_output(const DatasetInfo& dataset) {
  const Clock clock(summary_, "finishing");
  store_.refresh();
  summary_.is_complete = store_.done_count() >= dataset.capture_count;
  if (!summary_.is_complete) return;
  Transaction transaction;
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    const RecordReader records = [&](const RecordVisitor& visitor) {
      store_.read_records(i, visitor);
    };
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->finish(records, files); });
  }
  store_.commit_finish(transaction, options_.shard);
}

std::string summary_text(const RunSummary& summary) {
  std::string text;
  double all = 0.0;
  for (const auto& [phase, seconds] : summary.seconds) all += seconds;
  for (const auto& [phase, seconds] : summary.seconds) {
    if (seconds < 0.05) continue;
    text += (text.empty() ? "time: " : ", ") + phase + " " + duration_text(seconds);
  }
  if (!text.empty()) text += "\n";
  int falling = 0;
  int outside = 0;
  const VisitReport* fastest = nullptr;
  const VisitReport* deepest = nullptr;
  for (const VisitReport& visit : summary.visits) {
    falling += visit.falling_objects;
    outside += int(visit.left_room.size());
    if (!fastest || visit.max_speed > fastest->max_speed) fastest = &visit;
    if (!deepest || visit.max_penetration_m > deepest->max_penetration_m) deepest = &visit;
  }
  char line[256];
  if (fastest) {
    std::snprintf(line, sizeof line,
                  "objects: %d falling over all visits, %d left the room; residual speed at most "
                  "%.4f m/s (visit %d), deepest penetration %.2f mm (visit %d",
                  falling, outside, fastest->max_speed, fastest->visit + 1,
                  deepest->max_penetration_m * 1000.0, deepest->visit + 1);
    text += line;
    text += (deepest->deepest_body.empty() ? "" : ", " + deepest->deepest_body) + ")\n";
  }
  for (const VisitReport& visit : summary.visits) {
    for (const std::string& path : visit.left_room) {
      text += "visit " + std::to_string(visit.visit + 1) + ": " + path + " left the room\n";
    }
  }
  std::snprintf(line, sizeof line, "%.1f MB written", double(summary.bytes_written) * 1e-6);
  text += line;
  text += " in " + duration_text(all) + "\n";
  if (summary.resumed > 0) {
    text += std::to_string(summary.resumed) + " captures were there before\n";
  }
  text += "Finished, captured " + std::to_string(summary.captures * summary.cameras) + " frames (" +
          std::to_string(summary.captures) + " captures x " + std::to_string(summary.cameras) +
          " cameras)";
  return text;
}

}  // namespace diorama
