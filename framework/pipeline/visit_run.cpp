// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/visit_run.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "diorama/error.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"
#include "framework/config/clean_text.h"
#include "framework/pipeline/physics_view.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/pipeline/stopwatch.h"
#include "framework/plugins/fatal_end.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {

/// Which numbers randomizers draw at a moment: 0 of any stream are the first ones.
struct VisitRun::Draw {
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

/// How objects and their parts moved before randomizers placed some of them anew.
class ObjectMotion {
 public:
  ObjectMotion(const Scene& scene, const std::vector<NodeId>& objects) {
    for (const NodeId object : objects) {
      for (const NodeId part : scene.subtree(object)) {
        const auto& body = scene[part].rigid_body;
        if (body) known_.push_back({part, scene.world_from_node(part).matrix(), *body});
      }
    }
  }
  /// What was carried elsewhere starts there at rest, unless a velocity was drawn as well.
  void stop_what_was_placed(Scene& scene) const {
    for (const Known& known : known_) {
      const auto& body = scene[known.node].rigid_body;
      if (!body || body->linear_velocity != known.body.linear_velocity ||
          body->angular_velocity != known.body.angular_velocity ||
          scene.world_from_node(known.node).matrix() == known.world_from_node) {
        continue;
      }
      if (body->linear_velocity.isZero(0.0) && body->angular_velocity.isZero(0.0)) continue;
      scene.set_velocity(known.node, Vec3::Zero(), Vec3::Zero());
    }
  }

 private:
  struct Known {
    NodeId node;
    Mat4 world_from_node;
    RigidBody body;
  };
  std::vector<Known> known_;
};

/// Cameras whose pictures show how they move along their paths. Those that ride on a body move as
/// it does anyway.
class OpenShutters {
 public:
  OpenShutters(const Scene& scene, const std::vector<NodeId>& cameras) {
    for (const NodeId node : cameras) {
      const Camera& camera = *scene[node].camera;
      if (camera.exposure_time_s + camera.readout_time_s <= 0.0 || is_on_body(scene, node))
        continue;
      cameras_.push_back({node, camera.linear_velocity, camera.angular_velocity});
    }
  }
  /// Gives them the velocities of their paths, on top of what a randomizer drew.
  void move(Scene& scene, const ClipTrack& track, int frame, double fps) const {
    const int before = std::max(frame - 1, 0);
    const int after = std::min(frame + 1, track.size() - 1);
    if (before == after) return;
    const double per_s = fps / (after - before);
    for (const Open& open : cameras_) {
      const Affine from = track.world_from_node(scene, open.node, before);
      const Affine to = track.world_from_node(scene, open.node, after);
      const Eigen::AngleAxisd turn(Mat3(to.rotation() * from.rotation().transpose()));
      scene.set_velocity(open.node,
                         open.linear_velocity + per_s * (to.translation() - from.translation()),
                         open.angular_velocity + per_s * turn.angle() * turn.axis());
    }
  }
  void restore(Scene& scene) const {
    for (const Open& open : cameras_) {
      scene.set_velocity(open.node, open.linear_velocity, open.angular_velocity);
    }
  }

 private:
  struct Open {
    NodeId node;
    Vec3 linear_velocity;
    Vec3 angular_velocity;
  };
  static bool is_on_body(const Scene& scene, NodeId node) {
    while (node && !scene[node].rigid_body) node = scene[node].parent;
    return bool(node);
  }
  std::vector<Open> cameras_;
};

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

}  // namespace

Interrupted::~Interrupted() = default;

VisitRun::VisitRun(Setting setting, const PlannedVisit& planned)
    : setting_(std::move(setting)),
      job_(setting_.job),
      components_(setting_.components),
      host_(setting_.host),
      planned_(planned) {}

VisitRun::~VisitRun() = default;

VisitResult VisitRun::run() {
  set_up();
  randomize("environment", 0, -1);
  note(scene_, find_born_inside(scene_, objects_), report_.born_inside);
  report_.born = as_set_up_.placed_since(scene_);
  reset_physics();
  for_each_step(job_.timeline, [&](const TimelineStep& step) {
    if (next_capture_ == planned_.capture_count) return false;
    switch (step.kind) {
      case TimelineStep::Kind::Simulate:
        --simulations_to_come_;
        simulate(step);
        break;
      case TimelineStep::Kind::Capture:
        take_captures(step);
        break;
      case TimelineStep::Kind::Record:
        record(step);
        break;
      case TimelineStep::Kind::Event:
        randomize(step.name, events_[step.name]++, -1);
        break;
      case TimelineStep::Kind::Repeat:
        break;
    }
    return true;
  });
  result_.respawned = int(report_.respawned.size());
  return std::move(result_);
}

void VisitRun::set_up() {
  const Stopwatch watch(result_.seconds["loading"]);
  setting_.stop_if_asked();
  const EnvironmentChoice& choice = setting_.plan.environments[planned_.environment];
  host_.log(LogLevel::Info, "visit " + std::to_string(planned_.index + 1) + " of " +
                                std::to_string(setting_.plan.visit_count()) + ": " + choice.asset);
  environment_ = load_environment(choice.asset, job_.environments[choice.entry],
                                  *components_.environments[choice.entry], scene_, host_);
  const std::vector<NodeId> to_hide = nodes_to_hide(job_.environment.hide, environment_, scene_);
  working_area_world_ =
      apply_environment_rules(job_.environment, job_.debug, environment_, scene_, host_);
  objects_ = spawn_objects(plan_objects(job_, setting_.plan.object_assets, planned_.index), job_,
                           scene_, host_);
  hidden_.note_new(scene_);
  // What is hidden for the debug mode's picture from above is there all the same.
  hidden_.hidden_by_job(to_hide);
  as_set_up_ = SceneAsSetUp(scene_);
  create_lights(job_.lights, scene_, host_);
  cameras_ = create_cameras(job_.cameras, scene_);
  small_cameras_ = create_small_cameras(job_, cameras_, scene_);
  for_each_step(job_.timeline, [&](const TimelineStep& step) {
    simulations_to_come_ +=
        int(step.kind == TimelineStep::Kind::Simulate || step.kind == TimelineStep::Kind::Record);
    return true;
  });
  setting_.environment_patterns.try_in(
      scene_, environment_, choice.asset, host_,
      [this](const EnvironmentPatterns::Look& look) { show_other_environments(look); });
  // The first visit of each environment shows it from above.
  if (job_.debug && std::size_t(planned_.index) == planned_.environment) {
    overview_ = create_overview_camera(working_area_world_, scene_);
  }
}

/// Each as it is loaded.
void VisitRun::show_other_environments(const EnvironmentPatterns::Look& look) {
  const std::vector<EnvironmentChoice>& choices = setting_.plan.environments;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i == planned_.environment) continue;
    setting_.stop_if_asked();
    Scene scene;
    const NodeId environment =
        load_environment(choices[i].asset, job_.environments[choices[i].entry],
                         *components_.environments[choices[i].entry], scene, host_);
    if (!look(scene, environment)) return;
  }
}

void VisitRun::randomize(const std::string& moment, int number, int capture,
                         const std::optional<ClipFrame>& clip) {
  const Stopwatch watch(result_.seconds["randomizing"]);
  const PhysicsView before(scene_);
  const std::vector<Mat4> poses = object_poses(scene_, objects_);
  const ObjectMotion motion(scene_, objects_);
  camera_randomizers_ = call_randomizers(moment, number, capture, {}, clip);
  if (moment == "environment" || before.is_of(scene_)) return;
  motion.stop_what_was_placed(scene_);
  if (object_poses(scene_, objects_) != poses) before_last_step_.clear();
  // The engine holds everything as it was, and what sleeps there rests on what may be gone.
  reset_physics();
}

/// Returns those that moved cameras or changed their lenses.
std::vector<std::size_t> VisitRun::call_randomizers(const std::string& moment, int number,
                                                    int capture, const Draw& draw,
                                                    const std::optional<ClipFrame>& clip) {
  RandomizeContext context;
  context.clip = clip;
  context.moment = moment;
  context.capture = capture;
  context.working_area_world = working_area_world_;
  std::vector<std::size_t> of_cameras;
  for (std::size_t i = 0; i < job_.randomizers.size(); ++i) {
    if (draw.only && std::ranges::find(*draw.only, i) == draw.only->end()) continue;
    const RandomizerEntry& entry = job_.randomizers[i];
    const auto call = randomizer_call(job_, entry, moment, planned_.index, number);
    if (!call) continue;
    context.occurrence = call->occurrence;
    Rng rng = setting_.streams.randomizer(entry.name, call->visit, moment,
                                          capture >= 0 ? capture : number);
    if (draw.number > 0) rng = rng.fork(draw.stream).fork(std::uint64_t(draw.number));
    const SavedView cameras(scene_, camera_tops(scene_));
    call_component("randomizer '" + entry.name + "'",
                   [&] { components_.randomizers[i]->randomize(scene_, context, rng); });
    if (!cameras.is_of(scene_)) of_cameras.push_back(i);
  }
  return of_cameras;
}

void VisitRun::reset_physics() {
  if (!components_.physics) return;
  hidden_.note_new(scene_);
  const HiddenNodes::Aside aside(scene_, hidden_);
  call_component("physics '" + job_.physics.type + "'",
                 [&] { components_.physics->reset(scene_); });
}

/// Takes the steps, and deals with what has not settled afterwards.
void VisitRun::simulate(const TimelineStep& step) {
  // What is stuck halfway, or what has not settled at the end.
  const auto take_steps = [&] {
    std::vector<NodeId> spheres;
    if (step.camera_radius_m > 0.0) {
      spheres = create_camera_spheres(cameras_, step.camera_radius_m, scene_);
      reset_physics();
    }
    std::vector<Flaw> stuck = advance(step);
    for (const NodeId sphere : spheres) scene_.erase(sphere);
    if (!spheres.empty()) reset_physics();
    if (!stuck.empty() || job_.settle.policy == "keep") return stuck;
    return unsettled(step);
  };
  std::vector<Flaw> flaws = take_steps();
  if (job_.settle.policy == "keep") return;
  if (job_.settle.policy == "respawn") {
    for (int i = 0; i < job_.settle.max_respawns && !flaws.empty(); ++i) {
      respawn(flaws);
      flaws = take_steps();
    }
  }
  while (!flaws.empty()) {
    drop(flaws);
    // What lay on them falls.
    if (!step.until_rest) return;
    flaws = take_steps();
  }
}

/// After a fixed number of steps things may well be in motion; nothing may be outside the room.
std::vector<Flaw> VisitRun::unsettled(const TimelineStep& step) const {
  if (!components_.physics) return {};
  const Room room(scene_, environment_);
  if (step.until_rest) {
    return find_unsettled(scene_, room, objects_, last_step(), {job_.settle.rest_speed});
  }
  std::vector<Flaw> flaws;
  for (const NodeId object : objects_) {
    if (!room.holds(scene_, object)) flaws.push_back({object, "left the room"});
  }
  return flaws;
}

/// Until rest it ends as soon as something is stuck and stays where it is: those things are
/// returned. Nothing gets it out, and to simulate it takes ten times as long as all else.
std::vector<Flaw> VisitRun::advance(const TimelineStep& step) {
  const Stopwatch watch(result_.seconds["simulating"]);
  const Room room(scene_, environment_);
  // Short enough that Ctrl-C is felt, and that the time to rest is known well.
  constexpr int kStepsAtOnce = 5;
  const auto take = [&](int steps) {
    if (!components_.physics) return;
    call_component("physics '" + job_.physics.type + "'",
                   [&] { components_.physics->advance(scene_, steps); });
    simulated_s_ += steps * components_.physics->step_seconds();
  };
  const double start_s = simulated_s_;
  const auto is_at_rest = [&] {
    return simulated_s_ - std::max(start_s, moving_until_s_) >= kRestS - 1e-9;
  };
  constexpr double kStuckLookS = 0.5;
  JitterWatch jitter;
  PlaceWatch places;
  double looked_s = start_s;
  for (int taken = 0; taken < step.steps;) {
    setting_.stop_if_asked();
    const int now = step.each_step.empty() ? std::min(kStepsAtOnce, step.steps - taken) : 1;
    // The last step goes by itself: what it moves is the motion that captures show, and how fast
    // objects are.
    take(now - 1);
    before_last_step_ = body_poses(scene_);
    take(1);
    if (components_.physics) last_step_s_ = components_.physics->step_seconds();
    taken += now;
    if (!step.each_step.empty()) randomize(step.each_step, events_[step.each_step]++, -1);
    if (fastest_falling(scene_, room, objects_, last_step()) > job_.settle.rest_speed) {
      moving_until_s_ = simulated_s_;
    }
    if (!components_.physics) return {};
    if (!step.until_rest) continue;
    jitter.look(scene_, room, objects_, last_step(), job_.settle.rest_speed, simulated_s_);
    const bool is_over = is_at_rest() || jitter.only_jitter_is_left(simulated_s_);
    if (taken >= step.at_least && is_over) return {};
    if (job_.settle.policy == "keep" || simulated_s_ - looked_s < kStuckLookS) continue;
    looked_s = simulated_s_;
    const std::vector<NodeId> settled = places.settled_since(scene_, room, objects_);
    std::vector<Flaw> stuck = find_stuck(scene_, objects_, settled, {job_.settle.rest_speed});
    if (!stuck.empty()) return stuck;
  }
  return {};
}

/// Places the objects as the moment "environment" may place them, where they meet nothing; all else
/// stays as it is.
void VisitRun::respawn(const std::vector<Flaw>& flaws) {
  const Stopwatch watch(result_.seconds["randomizing"]);
  // The randomizers place all objects, and clear of each other; those that stay are elsewhere.
  constexpr int kDraws = 16;
  note(scene_, flaws, report_.respawned);
  const ObjectMotion motion(scene_, objects_);
  std::vector<NodeId> to_place = nodes_of(flaws);
  for (int i = 0; i < kDraws && !to_place.empty(); ++i) {
    const SavedNodes others(scene_, to_place);
    call_randomizers("environment", 0, -1, {"respawn", ++redraws_});
    others.restore(scene_);
    std::vector<NodeId> inside = nodes_of(find_born_inside(scene_, objects_));
    std::erase_if(to_place, [&](NodeId object) {
      return std::find(inside.begin(), inside.end(), object) == inside.end();
    });
  }
  motion.stop_what_was_placed(scene_);
  before_last_step_.clear();
  reset_physics();
}

void VisitRun::drop(const std::vector<Flaw>& flaws) {
  note(scene_, flaws, report_.dropped);
  for (const NodeId object : nodes_of(flaws)) {
    scene_.erase(object);
    std::erase(objects_, object);
  }
  // The others stay where their last step took them: captures show its motion.
  reset_physics();
}

void VisitRun::take_captures(const TimelineStep& step) {
  for (int i = 0; i < step.count; ++i) {
    if (next_capture_ == planned_.capture_count) return;
    const PlannedCapture planned = setting_.plan.capture(planned_.first_capture + next_capture_++);
    randomize(planned.phase, planned.number, planned.index);
    take_or_pass(planned);
  }
}

/// A clip is played one frame ahead of those that are shown, so that each knows what comes before
/// and after it. What the end of the job leaves of a clip is what the whole clip begins with.
void VisitRun::record(const TimelineStep& step) {
  const PlannedCapture first = setting_.plan.capture(planned_.first_capture + next_capture_);
  const int frames = first.clip->frame_count;
  if (frames == step.count) --simulations_to_come_;
  ClipFrame at = *first.clip;
  at.frame_count = step.count;
  randomize(first.phase, first.number, first.index, at);
  const OpenShutters shutters(scene_, cameras_);
  track_ = {};
  watch_ = PlayWatch(scene_);
  for (int frame = 0; frame < frames; ++frame) {
    const int ahead = std::min(frame + 1, step.count - 1);
    while (track_.size() <= ahead) {
      if (track_.size() > 0) track_.show(track_.size() - 1, scene_);
      at.frame = track_.size();
      play(first, at);
    }
    track_.show(frame, scene_);
    const PlannedCapture planned = setting_.plan.capture(planned_.first_capture + next_capture_++);
    if (setting_.is_needed(planned.index)) shutters.move(scene_, track_, frame, step.fps);
    take_or_pass(planned);
  }
  shutters.restore(scene_);
}

/// Lets the time between two frames go by, and adds the later one to the track.
void VisitRun::play(const PlannedCapture& first, const ClipFrame& at) {
  const Stopwatch watch(result_.seconds["simulating"]);
  setting_.stop_if_asked();
  const double seconds = 1.0 / at.fps;
  if (at.frame > 0) call_players(first, at, &Randomizer::lead);
  if (components_.physics && at.frame > 0) {
    call_component("physics '" + job_.physics.type + "'",
                   [&] { components_.physics->carry(scene_, seconds); });
    // As many as the job's steps, or a little shorter ones.
    const int steps = int(std::ceil(seconds / components_.physics->step_seconds() - 1e-9));
    last_step_s_ = seconds / steps;
    const auto take_steps = [&](int count) {
      call_component("physics '" + job_.physics.type + "'",
                     [&] { components_.physics->advance(scene_, count, last_step_s_); });
    };
    take_steps(steps - 1);
    before_last_step_ = body_poses(scene_);
    take_steps(1);
    simulated_s_ += seconds;
    const Room room(scene_, environment_);
    if (fastest_falling(scene_, room, objects_, last_step()) > job_.settle.rest_speed) {
      moving_until_s_ = simulated_s_;
    }
  }
  call_players(first, at, &Randomizer::play);
  track_.add(scene_);
}

/// Calls all randomizers that acted when the clip began.
void VisitRun::call_players(const PlannedCapture& first, const ClipFrame& at,
                            void (Randomizer::*show)(Scene&, const ClipFrame&)) {
  watch_.begin_frame(scene_);
  for (std::size_t i = 0; i < job_.randomizers.size(); ++i) {
    const RandomizerEntry& entry = job_.randomizers[i];
    if (!randomizer_call(job_, entry, first.phase, planned_.index, first.number)) continue;
    call_component("randomizer '" + entry.name + "'", [&] {
      (*components_.randomizers[i].*show)(scene_, at);
      watch_.check(scene_);
    });
  }
}

/// The visit's report tells of all its captures, so that it is the same whichever of them were made
/// before: those that are not needed are looked at as well, as far as the report needs it.
void VisitRun::take_or_pass(const PlannedCapture& planned) {
  if (setting_.is_needed(planned.index)) return take(planned);
  const int last = planned_.first_capture + planned_.capture_count - 1;
  if (!setting_.is_needed(last)) return;
  setting_.stop_if_asked();
  const SavedView drawn(scene_, camera_tops(scene_));
  ViewSearch search = view_search(planned, true);
  if (search.needs_pictures()) {
    take_frames(planned, search);
  } else {
    choose_views(search);
    note_blocked_cameras();
  }
  drawn.restore(scene_);
}

void VisitRun::take(const PlannedCapture& planned) {
  setting_.stop_if_asked();
  setting_.before_capture();
  const AtCapture at_capture(planned.index);
  PendingCapture pending;
  Capture& capture = pending.capture;
  capture.index = planned.index;
  capture.visit = planned_.index;
  capture.phase = planned.phase;
  capture.clip = planned.clip;
  capture.environment = clean_name(setting_.plan.environments[planned_.environment].asset);
  const SavedView drawn(scene_, camera_tops(scene_));
  ViewSearch search = view_search(planned);
  capture.frames = take_frames(planned, search);
  const std::vector<ViewOutcome> views = search.outcomes();
  if (!views.empty()) pending.views_json = outcomes_json(views);
  result_.views.emplace_back(planned.index, views);
  result_.refused += refused_draws(views);
  if (overview_ && next_capture_ == 1) {
    pending.overview = make_overview(planned.index);
  }
  // The next capture starts from where the randomizers put the cameras, whatever views this one
  // chose: it may be made alone.
  drawn.restore(scene_);
  // A visit that is cut short ends with its objects in the air, which says nothing.
  const bool is_last = next_capture_ == planned_.capture_count;
  if (is_last && simulations_to_come_ == 0) {
    const VisitReport& report = result_.reports.emplace_back(make_report());
    pending.settle_json = settle_json(report);
  }
  ++result_.captures;
  result_.respawned = int(report_.respawned.size());
  const Stopwatch watch(result_.seconds["waiting for writers"]);
  setting_.hand_over(std::move(pending), result_);
}

void VisitRun::prepare_renderer() {
  const Stopwatch watch(result_.seconds["preparing renderer"]);
  call_component("renderer '" + job_.renderer.type + "'",
                 [&] { components_.renderer->prepare(scene_); });
}

ViewSearch VisitRun::view_search(const PlannedCapture& planned, bool is_passed) {
  return ViewSearch({job_, setting_.streams, host_, *components_.renderer, scene_, cameras_,
                     small_cameras_, planned, is_passed, !camera_randomizers_.empty(),
                     [this, planned](int number) {
                       call_randomizers(planned.phase, planned.number, planned.index,
                                        {"view", number, &camera_randomizers_});
                     }});
}

void VisitRun::choose_views(ViewSearch& search) {
  const double before = search.refused_s();
  {
    const Stopwatch watch(result_.seconds["choosing views"]);
    search.run();
  }
  const double refused = search.refused_s() - before;
  result_.seconds["choosing views"] -= refused;
  result_.seconds["refusing views"] += refused;
}

void VisitRun::note_blocked_cameras() {
  note(scene_, find_blocked_cameras(scene_, cameras_), report_.cameras);
}

/// The pictures of all cameras, from views as the job wants them.
std::vector<Frame> VisitRun::take_frames(const PlannedCapture& planned, ViewSearch& search) {
  std::vector<Frame> frames;
  // What moved since the last picture is no cost of choosing.
  if (search.judges_views()) prepare_renderer();
  choose_views(search);
  prepare_renderer();
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    setting_.stop_if_asked();
    frames.push_back(make_frame(i, planned));
  }
  for (auto refused = search.refuse_pictures(frames); !refused.empty();) {
    choose_views(search);
    prepare_renderer();
    for (const std::size_t i : refused) frames[i] = make_frame(i, planned);
    refused = search.refuse_pictures(frames);
  }
  note_blocked_cameras();
  measure_flows(planned.clip, frames);
  return frames;
}

/// Last of all: it shows the renderer the frames beside this one.
void VisitRun::measure_flows(const std::optional<ClipFrame>& clip, std::vector<Frame>& frames) {
  const Demand& demand = setting_.shared.demand;
  if (!demand.flow_forward && !demand.flow_backward) return;
  const Stopwatch watch(result_.seconds["annotating"]);
  const int frame = clip ? clip->frame : 0;
  const auto measure = [&](int other, const Channel<Vec2f>& flow,
                           const Channel<std::uint32_t>& states) {
    if (!clip || other < 0 || other >= clip->frame_count) {
      for (Frame& each : frames) {
        const int width = each.camera.width;
        const int height = each.camera.height;
        each.set(flow, Image<Vec2f>(width, height, Vec2f::Zero()));
        each.set(states, Image<std::uint32_t>(width, height, std::uint32_t(FlowState::Unknown)));
      }
      return;
    }
    std::vector<FlowMeter> meters;
    for (const Frame& each : frames) meters.emplace_back(scene_, each, nodes_in(other));
    track_.show(other, scene_);
    prepare_renderer();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      meters[i].set_seen(call_component("renderer '" + job_.renderer.type + "'", [&] {
        return components_.renderer->sees(cameras_[i], meters[i].points());
      }));
      frames[i].set(flow, meters[i].flow());
      frames[i].set(states, meters[i].states());
    }
    track_.show(frame, scene_);
  };
  if (demand.flow_forward) measure(frame + 1, kFlowForward, kFlowForwardState);
  if (demand.flow_backward) measure(frame - 1, kFlowBackward, kFlowBackwardState);
  if (clip) prepare_renderer();
}

/// Where nodes are in another frame of the clip, and in which shape.
FlowMeter::NodeThere VisitRun::nodes_in(int frame) const {
  return [this, frame](NodeId node) {
    return FlowMeter::There{track_.world_from_node(scene_, node, frame), track_.mesh(node, frame)};
  };
}

/// How far things moved since the last frame of a clip, or the last step of the simulation.
void VisitRun::set_motion(const std::optional<ClipFrame>& clip, Frame& frame) {
  if (!clip) {
    measure_motion(scene_, before_last_step_, frame);
    return;
  }
  Image<Vec2f> motion(frame.camera.width, frame.camera.height, Vec2f::Zero());
  if (clip->frame > 0) {
    motion = FlowMeter(scene_, frame, nodes_in(clip->frame - 1)).flow();
    for (Vec2f& pixel : motion.pixels()) pixel = Vec2f::Zero() - pixel;
  }
  frame.set(kMotion, std::move(motion));
}

Frame VisitRun::make_frame(std::size_t camera, const PlannedCapture& planned) {
  const NodeId node = cameras_[camera];
  const std::string who = "renderer '" + job_.renderer.type + "'";
  RenderRequest request;
  request.camera = node;
  request.channels = setting_.shared.demand.channels;
  request.seed = setting_.streams.render_seed(planned.index, scene_[node].name);
  Frame frame;
  {
    const Stopwatch watch(result_.seconds["rendering"]);
    frame = call_component(who, [&] { return components_.renderer->render(request); });
  }
  const Stopwatch watch(result_.seconds["annotating"]);
  for (const auto& entry : components_.annotators) {
    call_component("annotator '" + entry.type + "'",
                   [&] { entry.annotator->annotate(scene_, frame); });
  }
  if (setting_.shared.demand.visibility) {
    measure_coverage(node, frame);
  }
  if (setting_.shared.demand.motion) set_motion(planned.clip, frame);
  return frame;
}

/// In groups: masks reach beyond the image, and all of a room's would take gigabytes.
void VisitRun::measure_coverage(NodeId camera, Frame& frame) {
  constexpr std::size_t kGroupBytes = std::size_t(256) << 20;
  const auto all = labelled_instances(scene_);
  const bool is_ordered = setting_.shared.demand.occlusion_order;
  const std::size_t largest = 9 * std::size_t(frame.camera.width) *
                              std::size_t(frame.camera.height) *
                              (1 + (is_ordered ? sizeof(float) : 0));
  const std::size_t group =
      std::max(kGroupBytes / largest, std::size_t(std::max(1, host_.thread_count())));
  VisibilityMeter meter(setting_.shared.demand.amodal_mask, frame);
  std::vector<CoverageMask> inside;
  for (std::size_t first = 0; first < all.size(); first += group) {
    const auto part = std::span(all).subspan(first, std::min(group, all.size() - first));
    auto coverage = call_component("renderer '" + job_.renderer.type + "'", [&] {
      return components_.renderer->cover(camera, part, is_ordered);
    });
    meter.add(coverage);
    if (!is_ordered) continue;
    for (CoverageMask& mask : coverage) {
      inside.push_back(inside_image(std::move(mask), frame.camera));
    }
  }
  if (is_ordered) order_occlusions(inside, frame);
}

Image<Rgba8> VisitRun::make_overview(int capture) {
  const Stopwatch watch(result_.seconds["rendering"]);
  if (!components_.renderer->provides().contains(kColor.name)) return {};
  RenderRequest request;
  request.camera = overview_;
  request.channels = {std::string(kColor.name)};
  request.seed = setting_.streams.render_seed(capture, "overview");
  return call_component("renderer '" + job_.renderer.type + "'",
                        [&] { return components_.renderer->render(request).get(kColor); });
}

VisitReport VisitRun::make_report() const {
  VisitReport report = report_;
  report.visit = planned_.index;
  report.environment = clean_name(setting_.plan.environments[planned_.environment].asset);
  report.simulated_s = simulated_s_;
  if (moving_until_s_ < simulated_s_ || simulated_s_ == 0.0) {
    report.rest_after_s = moving_until_s_;
  }
  if (components_.physics) {
    const PhysicsReport state = components_.physics->report();
    report.max_penetration_m = state.max_penetration_m;
    report.deepest_body = state.deepest_body;
  }
  const Room room(scene_, environment_);
  if (components_.physics) {
    note(scene_, find_unsettled(scene_, room, objects_, last_step(), {job_.settle.rest_speed}),
         report.unsettled);
  }
  report.max_speed = fastest_falling(scene_, room, objects_, last_step());
  if (components_.physics) {
    report.step_s = last_step_s_ > 0.0 ? last_step_s_ : components_.physics->step_seconds();
  }
  report.placed = as_set_up_.placed_since(scene_);
  for (const NodeId object : objects_) {
    const auto& body = scene_[object].rigid_body;
    ObjectAtEnd& end = report.objects.emplace_back();
    end.path = scene_.path(object);
    end.falls = body && body->has_gravity;
    if (end.falls) ++report.falling_objects;
    if (const auto before = before_last_step_.find(object); before != before_last_step_.end()) {
      end.before_last_step = before->second.translation();
    }
    if (!room.holds(scene_, object)) report.left_room.push_back(scene_.path(object));
  }
  return report;
}

}  // namespace diorama
