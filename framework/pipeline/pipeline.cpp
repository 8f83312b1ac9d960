// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pipeline.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>

#include "diorama/error.h"
#include "framework/annotators/motion.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"
#include "framework/config/clean_text.h"
#include "framework/pipeline/physics_view.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/pipeline/view_search.h"
#include "framework/plugins/fatal_end.h"
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
  std::map<NodeId, NodeId> small_cameras;  ///< For the brightness of views; by camera.
  /// Randomizers that placed cameras at the last moment.
  std::vector<std::size_t> camera_randomizers;
  int next_capture = 0;  ///< Of the visit's.
  std::map<std::string, int> events;
  int simulations_to_come = 0;  ///< Steps of the timeline that let things move.
  double simulated_s = 0.0;
  double moving_until_s = 0.0;  ///< When something in the room was last seen moving.
  int redraws = 0;              ///< Streams that placed objects anew so far.
  VisitReport report;
};

/// Which numbers randomizers draw at a moment: 0 of any stream are the first ones.
struct Pipeline::Draw {
  const char* stream = "";
  int number = 0;
  const std::vector<std::size_t>* only = nullptr;  ///< Indices of randomizers; null: all.
};

namespace {

std::vector<Mat4> object_poses(const Scene& scene, const std::vector<NodeId>& objects) {
  std::vector<Mat4> poses;
  poses.reserve(objects.size());
  for (const NodeId object : objects) poses.push_back(scene.world_from_node(object).matrix());
  return poses;
}

/// Cameras and rigs.
std::vector<NodeId> camera_tops(const Scene& scene) {
  const NodeId parent = scene.find("/Cameras");
  return parent ? scene[parent].children : std::vector<NodeId>();
}

std::vector<NodeId> nodes_of(const std::vector<Flaw>& flaws) {
  std::vector<NodeId> nodes;
  for (const Flaw& flaw : flaws) nodes.push_back(flaw.node);
  return nodes;
}

void note(const Scene& scene, const std::vector<Flaw>& flaws, std::vector<Incident>& incidents) {
  for (const Flaw& flaw : flaws) incidents.push_back({scene.path(flaw.node), flaw.why});
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
      streams_(job.seed) {}

Pipeline::~Pipeline() = default;

RunSummary Pipeline::run(const DatasetInfo& dataset, const std::string& dataset_json) {
  dataset_ = &dataset;
  dataset_json_ = &dataset_json;
  summary_.cameras = int(dataset.camera_names.size());
  store_.join(dataset_json);
  for_each_visit([&](const PlannedVisit& visit) {
    total_ += visit.capture_count;
    for (int i = 0; i < visit.capture_count; ++i) {
      summary_.resumed += store_.is_done(visit.first_capture + i) ? 1 : 0;
    }
  });
  const int writing_threads = std::clamp(host_.thread_count(), 1, 4);
  queue_ = std::make_unique<WriterQueue>(writing_threads, options_.queue_bytes,
                                         [this](const PendingCapture& pending) { write(pending); });
  try {
    run_visits();
    const Clock clock(summary_, "waiting for writers");
    if (!queue_->drain(options_.stop)) throw Interrupted();
  } catch (const Interrupted&) {
    end_early();
    throw;
  } catch (const Stopped&) {
    end_early();
    throw Interrupted();
  }
  finish_output(dataset);
  store_.close();
  summary_.bytes_written = store_.bytes_written();
  return std::move(summary_);
}

void Pipeline::for_each_visit(const std::function<void(const PlannedVisit&)>& visit) const {
  for (int i = 0; i < plan_.visit_count(); ++i) {
    const bool is_own = options_.takes_visits || is_in_shard(i, options_.shard, options_.shards);
    if (is_own) visit(plan_.visit(i));
  }
}

void Pipeline::run_visits() {
  if (options_.only_finishes) return;
  if (!options_.takes_visits) {
    for_each_visit([&](const PlannedVisit& visit) {
      if (is_needed(visit)) run_visit(visit);
    });
    return;
  }
  const auto needs_work = [&](int visit) { return is_needed(plan_.visit(visit)); };
  while (const auto visit = store_.claim_visit(plan_.visit_count(), needs_work)) {
    run_visit(plan_.visit(*visit));
  }
}

/// Keeps what is whole, and does not begin what a slow disk would hold up: who asked may not wait.
void Pipeline::end_early() {
  queue_->drop_waiting();
  queue_->drain();
  store_.close();
}

bool Pipeline::is_needed(const PlannedVisit& planned) const {
  for (int i = 0; i < planned.capture_count; ++i) {
    if (is_needed(planned.first_capture + i)) return true;
  }
  return false;
}

bool Pipeline::is_needed(int capture) const {
  return !store_.is_done(capture) && (!options_.only || options_.only->contains(capture));
}

void Pipeline::stop_if_asked() const {
  if (options_.stop && *options_.stop) throw Interrupted();
}

void Pipeline::run_visit(const PlannedVisit& planned) {
  Visit visit = set_up(planned);
  randomize(visit, "environment", 0, -1);
  note(visit.scene, find_born_inside(visit.scene, visit.objects), visit.report.born_inside);
  reset_physics(visit);
  for (const TimelineStep& step : job_.timeline) {
    if (visit.next_capture == planned.capture_count) return;
    switch (step.kind) {
      case TimelineStep::Kind::Simulate:
        --visit.simulations_to_come;
        simulate(visit, step);
        break;
      case TimelineStep::Kind::Capture:
        take_captures(visit, step);
        break;
      case TimelineStep::Kind::Event:
        randomize(visit, step.name, visit.events[step.name]++, -1);
        break;
    }
  }
  summary_.respawned += int(visit.report.respawned.size());
}

Pipeline::Visit Pipeline::set_up(const PlannedVisit& planned) {
  const Clock clock(summary_, "loading");
  stop_if_asked();
  const EnvironmentChoice& choice = plan_.environments[planned.environment];
  host_.log(LogLevel::Info, "visit " + std::to_string(planned.index + 1) + " of " +
                                std::to_string(plan_.visit_count()) + ": " + choice.asset);
  Visit visit;
  visit.planned = &planned;
  visit.environment = load_environment(choice.asset, job_.environments[choice.entry],
                                       *components_.environments[choice.entry], visit.scene, host_);
  visit.working_area_world =
      apply_environment_rules(job_.environment, job_.debug, visit.environment, visit.scene, host_);
  visit.objects = spawn_objects(plan_objects(job_, plan_.object_assets, planned.index), job_,
                                visit.scene, host_);
  create_lights(job_.lights, visit.scene, host_);
  visit.cameras = create_cameras(job_.cameras, visit.scene);
  visit.small_cameras = create_small_cameras(job_, visit.cameras, visit.scene);
  visit.simulations_to_come =
      int(std::count_if(job_.timeline.begin(), job_.timeline.end(), [](const TimelineStep& step) {
        return step.kind == TimelineStep::Kind::Simulate;
      }));
  for (const EnvironmentPattern& pattern : components_.environment_patterns) {
    if (!visit.scene.match(pattern.text).empty()) continue;
    host_.log(LogLevel::Warning,
              choice.asset + ": no node fits '" + pattern.text + "' (" + pattern.key + ")");
  }
  // The first visit of each environment shows it from above.
  if (job_.debug && std::size_t(planned.index) == planned.environment) {
    visit.overview = create_overview_camera(visit.working_area_world, visit.scene);
  }
  return visit;
}

void Pipeline::randomize(Visit& visit, const std::string& moment, int number, int capture) {
  const Clock clock(summary_, "randomizing");
  const PhysicsView before(visit.scene);
  const std::vector<Mat4> poses = object_poses(visit.scene, visit.objects);
  visit.camera_randomizers = call_randomizers(visit, moment, number, capture, {});
  if (moment == "environment" || before.is_of(visit.scene)) return;
  if (object_poses(visit.scene, visit.objects) != poses) visit.before_last_step.clear();
  // The engine holds everything as it was, and what sleeps there rests on what may be gone.
  reset_physics(visit);
}

/// Returns those that moved cameras or changed their lenses.
std::vector<std::size_t> Pipeline::call_randomizers(Visit& visit, const std::string& moment,
                                                    int number, int capture, const Draw& draw) {
  RandomizeContext context;
  context.moment = moment;
  context.capture = capture;
  context.working_area_world = visit.working_area_world;
  std::vector<std::size_t> of_cameras;
  for (std::size_t i = 0; i < job_.randomizers.size(); ++i) {
    if (draw.only && std::ranges::find(*draw.only, i) == draw.only->end()) continue;
    const RandomizerEntry& entry = job_.randomizers[i];
    const auto call = randomizer_call(job_, entry, moment, visit.planned->index, number);
    if (!call) continue;
    context.occurrence = call->occurrence;
    Rng rng = streams_.randomizer(entry.name, call->visit, moment, capture >= 0 ? capture : number);
    if (draw.number > 0) rng = rng.fork(draw.stream).fork(std::uint64_t(draw.number));
    const SavedView cameras(visit.scene, camera_tops(visit.scene));
    call_component("randomizer '" + entry.name + "'",
                   [&] { components_.randomizers[i]->randomize(visit.scene, context, rng); });
    if (!cameras.is_of(visit.scene)) of_cameras.push_back(i);
  }
  return of_cameras;
}

void Pipeline::reset_physics(Visit& visit) {
  for (auto& physics : components_.physics) {
    call_component("physics '" + job_.physics.type + "'", [&] { physics->reset(visit.scene); });
  }
}

/// Takes the steps, and deals with what has not settled afterwards.
void Pipeline::simulate(Visit& visit, const TimelineStep& step) {
  advance(visit, step);
  if (job_.settle.policy == "keep") return;
  std::vector<Flaw> flaws = unsettled(visit, step);
  if (job_.settle.policy == "respawn") {
    for (int i = 0; i < job_.settle.max_respawns && !flaws.empty(); ++i) {
      respawn(visit, flaws);
      advance(visit, step);
      flaws = unsettled(visit, step);
    }
  }
  while (!flaws.empty()) {
    drop(visit, flaws);
    // What lay on them falls.
    if (!step.until_rest) return;
    advance(visit, step);
    flaws = unsettled(visit, step);
  }
}

/// After a fixed number of steps things may well be in motion; nothing may be outside the room.
std::vector<Flaw> Pipeline::unsettled(const Visit& visit, const TimelineStep& step) const {
  if (components_.physics.empty()) return {};
  const Room room(visit.scene, visit.environment);
  if (step.until_rest) {
    return find_unsettled(visit.scene, room, visit.objects, {job_.settle.rest_speed});
  }
  std::vector<Flaw> flaws;
  for (const NodeId object : visit.objects) {
    if (!room.holds(visit.scene, object)) flaws.push_back({object, "left the room"});
  }
  return flaws;
}

void Pipeline::advance(Visit& visit, const TimelineStep& step) {
  const Clock clock(summary_, "simulating");
  const Room room(visit.scene, visit.environment);
  // Short enough that Ctrl-C is felt, and that the time to rest is known well.
  constexpr int kStepsAtOnce = 5;
  // At its highest point a thing is slow as well.
  constexpr double kRestS = 0.25;
  const auto take = [&](int steps) {
    for (auto& physics : components_.physics) {
      call_component("physics '" + job_.physics.type + "'",
                     [&] { physics->advance(visit.scene, steps); });
      visit.simulated_s += steps * physics->step_seconds();
    }
  };
  const double start_s = visit.simulated_s;
  const auto is_at_rest = [&] {
    return visit.simulated_s - std::max(start_s, visit.moving_until_s) >= kRestS - 1e-9;
  };
  for (int taken = 0; taken < step.steps;) {
    stop_if_asked();
    const int now = std::min(kStepsAtOnce, step.steps - taken);
    const bool may_be_last = step.until_rest || taken + now == step.steps;
    // The last step goes by itself: what it moves is the motion that captures show.
    if (may_be_last && components_.demand.motion) {
      take(now - 1);
      visit.before_last_step = body_poses(visit.scene);
      take(1);
    } else {
      take(now);
    }
    taken += now;
    if (fastest_falling(visit.scene, room, visit.objects) > job_.settle.rest_speed) {
      visit.moving_until_s = visit.simulated_s;
    }
    if (step.until_rest && taken >= step.at_least && is_at_rest()) return;
    if (components_.physics.empty()) return;
  }
}

/// Places the objects as the moment "environment" may place them, where they meet nothing; all else
/// stays as it is.
void Pipeline::respawn(Visit& visit, const std::vector<Flaw>& flaws) {
  const Clock clock(summary_, "randomizing");
  // The randomizers place all objects, and clear of each other; those that stay are elsewhere.
  constexpr int kDraws = 16;
  note(visit.scene, flaws, visit.report.respawned);
  std::vector<NodeId> to_place = nodes_of(flaws);
  for (int i = 0; i < kDraws && !to_place.empty(); ++i) {
    const SavedNodes others(visit.scene, to_place);
    call_randomizers(visit, "environment", 0, -1, {"respawn", ++visit.redraws});
    others.restore(visit.scene);
    std::vector<NodeId> inside = nodes_of(find_born_inside(visit.scene, visit.objects));
    std::erase_if(to_place, [&](NodeId object) {
      return std::find(inside.begin(), inside.end(), object) == inside.end();
    });
  }
  visit.before_last_step.clear();
  reset_physics(visit);
}

void Pipeline::drop(Visit& visit, const std::vector<Flaw>& flaws) {
  note(visit.scene, flaws, visit.report.dropped);
  for (const NodeId object : nodes_of(flaws)) {
    visit.scene.erase(object);
    std::erase(visit.objects, object);
  }
  // The others stay where their last step took them: captures show its motion.
  reset_physics(visit);
}

void Pipeline::take_captures(Visit& visit, const TimelineStep& step) {
  for (int i = 0; i < step.count; ++i) {
    if (visit.next_capture == visit.planned->capture_count) return;
    const PlannedCapture planned =
        plan_.capture(visit.planned->first_capture + visit.next_capture++);
    randomize(visit, planned.phase, planned.number, planned.index);
    if (is_needed(planned.index)) take(visit, planned);
  }
}

void Pipeline::take(Visit& visit, const PlannedCapture& planned) {
  stop_if_asked();
  begin_output();
  const AtCapture at_capture(planned.index);
  PendingCapture pending;
  Capture& capture = pending.capture;
  capture.index = planned.index;
  capture.visit = visit.planned->index;
  capture.phase = planned.phase;
  capture.environment = clean_name(plan_.environments[visit.planned->environment].asset);
  const SavedView drawn(visit.scene, camera_tops(visit.scene));
  const std::vector<ViewOutcome> views = take_frames(visit, planned, capture.frames);
  if (!views.empty()) pending.views_json = outcomes_json(views);
  summary_.views.add(planned.index, views);
  if (visit.overview && visit.next_capture == 1) {
    pending.overview = make_overview(visit, planned.index);
  }
  // The next capture starts from where the randomizers put the cameras, whatever views this one
  // chose: it may be made alone.
  drawn.restore(visit.scene);
  // A visit that is cut short ends with its objects in the air, which says nothing.
  const bool is_last = visit.next_capture == visit.planned->capture_count;
  if (is_last && visit.simulations_to_come == 0) {
    summary_.visits.push_back(report_on(visit));
    pending.settle_json = settle_json(summary_.visits.back());
  }
  {
    const Clock clock(summary_, "waiting for writers");
    if (!queue_->push(std::move(pending), options_.stop)) throw Interrupted();
  }
  ++summary_.captures;
  if (options_.progress) {
    options_.progress({summary_.resumed + summary_.captures, total_, summary_.resumed,
                       summary_.respawned + int(visit.report.respawned.size())});
  }
}

void Pipeline::prepare_renderer(const Visit& visit) {
  const Clock clock(summary_, "preparing renderer");
  call_component("renderer '" + job_.renderer.type + "'",
                 [&] { components_.renderer->prepare(visit.scene); });
}

/// The pictures of all cameras, from views as the job wants them.
std::vector<ViewOutcome> Pipeline::take_frames(Visit& visit, const PlannedCapture& planned,
                                               std::vector<Frame>& frames) {
  ViewSearch search({job_, streams_, host_, *components_.renderer, visit.scene, visit.cameras,
                     visit.small_cameras, planned, !visit.camera_randomizers.empty(),
                     [&](int number) {
                       call_randomizers(visit, planned.phase, planned.number, planned.index,
                                        {"view", number, &visit.camera_randomizers});
                     }});
  const auto choose_views = [&] {
    const Clock clock(summary_, "choosing views");
    search.run();
  };
  choose_views();
  note(visit.scene, find_blocked_cameras(visit.scene, visit.cameras), visit.report.cameras);
  prepare_renderer(visit);
  for (std::size_t i = 0; i < visit.cameras.size(); ++i) {
    stop_if_asked();
    frames.push_back(make_frame(visit, i, planned.index));
  }
  for (auto refused = search.refuse_pictures(frames); !refused.empty();) {
    choose_views();
    prepare_renderer(visit);
    for (const std::size_t i : refused) frames[i] = make_frame(visit, i, planned.index);
    refused = search.refuse_pictures(frames);
  }
  return search.outcomes();
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
  for (const auto& entry : components_.annotators) {
    call_component("annotator '" + entry.type + "'",
                   [&] { entry.annotator->annotate(visit.scene, frame); });
  }
  if (components_.demand.visibility) {
    const auto instances = labelled_instances(visit.scene);
    const bool is_ordered = components_.demand.occlusion_order;
    const auto coverage = call_component(
        who, [&] { return components_.renderer->cover(node, instances, is_ordered); });
    measure_visibility(coverage, components_.demand.amodal_mask, frame);
    if (is_ordered) order_occlusions(coverage, frame);
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
  VisitReport report = visit.report;
  report.visit = visit.planned->index;
  report.environment = clean_name(plan_.environments[visit.planned->environment].asset);
  report.simulated_s = visit.simulated_s;
  if (visit.moving_until_s < visit.simulated_s || visit.simulated_s == 0.0) {
    report.rest_after_s = visit.moving_until_s;
  }
  for (const auto& physics : components_.physics) {
    const PhysicsReport state = physics->report();
    report.max_penetration_m = state.max_penetration_m;
    report.deepest_body = state.deepest_body;
  }
  const Room room(visit.scene, visit.environment);
  if (!components_.physics.empty()) {
    note(visit.scene, find_unsettled(visit.scene, room, visit.objects, {job_.settle.rest_speed}),
         report.unsettled);
  }
  report.max_speed = fastest_falling(visit.scene, room, visit.objects);
  for (const NodeId object : visit.objects) {
    const auto& body = visit.scene[object].rigid_body;
    if (body && body->has_gravity) ++report.falling_objects;
    if (!room.holds(visit.scene, object)) report.left_room.push_back(visit.scene.path(object));
  }
  return report;
}

void Pipeline::begin_output() {
  if (has_begun_) return;
  has_begun_ = true;
  store_.open();
  Transaction transaction = store_.begin_transaction();
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->begin(*dataset_, files); });
  }
  store_.commit_begin(transaction);
}

void Pipeline::write(const PendingCapture& pending) {
  Transaction transaction = store_.capture_transaction(pending.capture.index);
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->write(pending.capture, files); });
  }
  const std::string visit_name = std::to_string(pending.capture.visit) + "_" +
                                 node_name(asset_stem(pending.capture.environment));
  if (!pending.settle_json.empty()) {
    const auto text = std::as_bytes(std::span(pending.settle_json));
    transaction.files.push_back(
        {kRecordsFolder, "settle/" + visit_name + ".json", {text.begin(), text.end()}});
  }
  if (!pending.views_json.empty()) {
    transaction.records.emplace_back(kRecordsFolder, pending.views_json);
  }
  if (const auto& overview = pending.overview; overview.width() > 0) {
    const ImageView view{overview.pixels().data(), overview.width(), overview.height(), 4, 8};
    transaction.files.push_back({kRecordsFolder, "overview/" + visit_name + ".png",
                                 host_.encode_image(view, ImageFormat::Png)});
  }
  store_.commit_capture(pending.capture.index, transaction);
}

void Pipeline::finish_output(const DatasetInfo& dataset) {
  const Clock clock(summary_, "finishing");
  store_.refresh();
  summary_.missing = dataset.capture_count - store_.done_count();
  summary_.is_finished = store_.is_finished();
  if (summary_.missing > 0 || summary_.is_finished) return;
  // Who loses this claim to another worker has done its part; the other one's is to finish.
  begin_output();
  if (!store_.claim_finish()) {
    summary_.is_finished = store_.is_finished();
    return;
  }
  Transaction transaction = store_.finish_transaction();
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    const RecordReader records = [&](const RecordVisitor& visitor) {
      store_.read_records(i, visitor);
    };
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->finish(records, files); });
  }
  if (!job_.views.empty()) {
    ViewCounts counts;
    store_.read_records(kRecordsFolder, [&](int capture, std::string_view line) {
      counts.add(capture, outcomes_from_json(line));
    });
    const std::string text = views_json(counts);
    const auto bytes = std::as_bytes(std::span(text));
    transaction.files.push_back({kRecordsFolder, kViewsFile, {bytes.begin(), bytes.end()}});
  }
  store_.commit_finish(transaction);
  summary_.is_finished = true;
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
  text += settle_text(summary.visits);
  text += views_text(summary.views);
  char line[64];
  std::snprintf(line, sizeof line, "%.1f MB written", double(summary.bytes_written) * 1e-6);
  text += line;
  text += " in " + duration_text(all) + "\n";
  if (summary.resumed > 0) {
    text += std::to_string(summary.resumed) + " captures were there before\n";
  }
  text += "Finished, captured " + std::to_string(summary.captures * summary.cameras) + " frames (" +
          std::to_string(summary.captures) + " captures x " + std::to_string(summary.cameras) +
          " cameras)";
  if (!summary.is_finished) {
    text += "; this part is done, ";
    text += summary.missing > 0 ? "the dataset lacks " + std::to_string(summary.missing) +
                                      " captures of other workers"
                                : "another worker finishes the dataset";
  }
  return text;
}

}  // namespace diorama
