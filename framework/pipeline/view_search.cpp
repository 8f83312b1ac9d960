// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/view_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "diorama/error.h"
#include "framework/config/joined.h"
#include "framework/pipeline/stopwatch.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

constexpr int kSmaller = 4;  // of width and height, for the brightness
// From one ray of the grids to the next, in pixels: what is decided by few costs little.
constexpr std::array kGridSteps = {8, 4};

auto numbers_of(const Camera& c) {
  return std::tie(c.width, c.height, c.lens, c.fx, c.fy, c.cx, c.cy, c.distortion,
                  c.fisheye_polynomial, c.fisheye_max_angle_rad, c.near_m, c.far_m,
                  c.focal_length_mm, c.horizontal_aperture_mm, c.focus_distance_m, c.f_stop,
                  c.exposure_time_s, c.readout_time_s, c.linear_velocity, c.angular_velocity);
}

bool are_equal(const std::optional<Camera>& a, const std::optional<Camera>& b) {
  return a.has_value() == b.has_value() && (!a || numbers_of(*a) == numbers_of(*b));
}

/// What a polynomial lens says of distances in pixels, when they get this much shorter.
void shrink_radii(Camera& camera, double by) {
  double scale = 1.0;
  for (double& term : camera.fisheye_polynomial) {
    term /= scale;
    scale *= by;
  }
}

/// The same view with fewer pixels.
Camera smaller(Camera camera) {
  const auto shrunk = [](int size) { return std::max(1, (size + kSmaller - 1) / kSmaller); };
  const double x = double(shrunk(camera.width)) / camera.width;
  const double y = double(shrunk(camera.height)) / camera.height;
  camera.width = shrunk(camera.width);
  camera.height = shrunk(camera.height);
  camera.fx *= x;
  camera.cx *= x;
  camera.fy *= y;
  camera.cy *= y;
  shrink_radii(camera, x);
  return camera;
}

/// The rays of every step-th pixel across and down, and no others. Null: there are too few of them
/// to tell anything.
std::optional<Camera> sparser(Camera camera, int step) {
  const int first = step / 2 - 1;
  constexpr int kLeast = 8;  // pixels of a side
  const auto counted = [&](int size) { return (size - first + step - 1) / step; };
  const auto moved = [&](double centre) { return 0.5 + (centre - (first + 0.5)) / step; };
  camera.width = counted(camera.width);
  camera.height = counted(camera.height);
  if (std::min(camera.width, camera.height) < kLeast) return std::nullopt;
  camera.fx /= step;
  camera.fy /= step;
  camera.cx = moved(camera.cx);
  camera.cy = moved(camera.cy);
  shrink_radii(camera, 1.0 / step);
  return camera;
}

/// The camera's own node, or the rig that it is part of: what stands below /Cameras.
NodeId top_of(const Scene& scene, NodeId camera) {
  NodeId top = camera;
  while (scene[top].parent != scene.root() && scene[scene[top].parent].parent != scene.root()) {
    top = scene[top].parent;
  }
  return top;
}

/// Nodes that fit the rule's pattern, and what is below them: it may name cameras or rigs.
std::set<NodeId> nodes_of(const Scene& scene, const ViewRule& rule) {
  std::set<NodeId> nodes;
  for (const NodeId top : scene.match(rule.cameras)) {
    for (const NodeId node : scene.subtree(top)) nodes.insert(node);
  }
  return nodes;
}

std::string limit_text(const std::map<std::string, int>& refused, int draws) {
  const auto most =
      std::max_element(refused.begin(), refused.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == refused.end()) return {};
  return "; most failed: " + most->first + " (" + std::to_string(most->second) + " of " +
         std::to_string(draws) + ")";
}

}  // namespace

SavedView::SavedView(const Scene& scene, const std::vector<NodeId>& tops) {
  for (const NodeId top : tops) {
    for (const NodeId node : scene.subtree(top)) {
      parts_.push_back({node, scene[node].parent_from_node, scene[node].camera});
    }
  }
}

void SavedView::restore(Scene& scene) const {
  for (const Part& part : parts_) {
    if (scene[part.node].parent_from_node.matrix() != part.parent_from_node.matrix()) {
      scene.set_pose(part.node, part.parent_from_node);
    }
    if (!are_equal(scene[part.node].camera, part.camera)) {
      scene.edit(part.node).camera = part.camera;
    }
  }
}

bool SavedView::is_of(const Scene& scene) const {
  return std::all_of(parts_.begin(), parts_.end(), [&](const Part& part) {
    return scene[part.node].parent_from_node.matrix() == part.parent_from_node.matrix() &&
           are_equal(scene[part.node].camera, part.camera);
  });
}

std::uint64_t view_number(const Job& job, const ViewRule& rule, int capture, std::size_t camera,
                          std::size_t cameras) {
  std::int64_t per_visit = 0;  // captures
  std::int64_t own_per_visit = 0;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    per_visit += step.count;
    if (step.count > 0 && rule.is_on(step.name)) own_per_visit += step.count;
    return true;
  });
  std::int64_t place = capture % per_visit;
  std::int64_t number = capture / per_visit * own_per_visit;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    const std::int64_t before = std::min<std::int64_t>(place, step.count);
    if (step.count > 0 && rule.is_on(step.name)) number += before;
    place -= before;
    return place > 0 || before == step.count;
  });
  return std::uint64_t(number) * cameras + camera;
}

SmallCameras create_small_cameras(const Job& job, const std::vector<NodeId>& cameras,
                                  Scene& scene) {
  std::set<NodeId> judged;
  std::set<NodeId> lit;
  for (const ViewRule& rule : job.views) {
    const std::set<NodeId> nodes = nodes_of(scene, rule);
    judged.insert(nodes.begin(), nodes.end());
    if (rule.brightness.is_set()) lit.insert(nodes.begin(), nodes.end());
  }
  SmallCameras small;
  const auto create = [&](NodeId camera) {
    const NodeId node = scene.create(scene.root(), "SmallView");
    scene.edit(node).camera = *scene[camera].camera;
    return node;
  };
  for (const NodeId camera : cameras) {
    if (lit.contains(camera)) small.of_light.emplace(camera, create(camera));
    if (!judged.contains(camera)) continue;
    for (std::size_t i = 0; i < kGridSteps.size(); ++i) {
      small.of_labels[camera].push_back(create(camera));
    }
  }
  return small;
}

/// Cameras that are drawn together, and how far their search is.
struct ViewSearch::Group {
  struct Member {
    std::size_t camera = 0;  ///< Index into the visit's.
    std::vector<WantedView> wanted;
  };
  std::vector<Member> members;
  std::vector<NodeId> tops;
  std::vector<std::string> impossible;  ///< What no view of this scene can hold.
  std::map<std::string, std::string> parts;
  int max_tries = 1;
  bool stops = false;
  int draws = 0;
  bool is_done = false;
  std::map<std::string, int> refused;
  std::vector<std::string> unmet;
  std::optional<ViewVerdict> best_verdict;  ///< Null: none was refused yet.
  SavedView best;
};

ViewSearch::ViewSearch(Setting setting) : setting_(std::move(setting)) {
  for (const ViewRule& rule : setting_.job.views) {
    if (rule.is_on(setting_.capture.phase)) rules_.push_back(&rule);
  }
  if (rules_.empty()) return;
  check_.emplace(setting_.scene, rules_);
  make_groups();
}

ViewSearch::~ViewSearch() = default;

WantedView ViewSearch::wanted_view(const ViewRule& rule, std::size_t camera) {
  const Scene& scene = setting_.scene;
  // Cameras of a rig are drawn as one, and look at the same.
  std::vector<NodeId> tops;
  const std::set<NodeId> own = nodes_of(scene, rule);
  for (const NodeId node : setting_.cameras) {
    if (!own.contains(node)) continue;
    const NodeId top = top_of(scene, node);
    if (std::ranges::find(tops, top) == tops.end()) tops.push_back(top);
  }
  const auto place = std::ranges::find(tops, top_of(scene, setting_.cameras[camera]));
  WantedView wanted{&rule, {}};
  const std::uint64_t number = view_number(setting_.job, rule, setting_.capture.index,
                                           std::size_t(place - tops.begin()), tops.size());
  for (std::size_t i = 0; i < rule.quotas.size(); ++i) {
    wanted.bins.emplace_back(
        quota_bin(rule.quotas[i], setting_.streams.views(rule.name, i), number));
  }
  return wanted;
}

void ViewSearch::make_groups() {
  const Scene& scene = setting_.scene;
  std::map<NodeId, std::size_t> group_of_top;
  std::optional<std::size_t> joint;  // of rules that draw their cameras together
  for (std::size_t camera = 0; camera < setting_.cameras.size(); ++camera) {
    const NodeId node = setting_.cameras[camera];
    std::vector<const ViewRule*> own;
    for (const ViewRule* rule : rules_) {
      if (nodes_of(scene, *rule).contains(node)) own.push_back(rule);
    }
    if (own.empty()) continue;
    const NodeId top = top_of(scene, node);
    const bool is_joint =
        std::any_of(own.begin(), own.end(), [](const ViewRule* rule) { return rule->together; });
    const bool is_new = !group_of_top.contains(top) && !(is_joint && joint);
    if (is_new) groups_.emplace_back();
    const std::size_t index = group_of_top.contains(top) ? group_of_top[top]
                              : is_joint && joint        ? *joint
                                                         : groups_.size() - 1;
    if (is_joint) joint = index;
    Group& group = groups_[index];
    if (group_of_top.emplace(top, index).second) group.tops.push_back(top);
    Group::Member member{camera, {}};
    for (const ViewRule* rule : own) {
      group.max_tries = std::max(group.max_tries, rule->max_tries);
      group.stops = group.stops || rule->at_limit == "stop";
      WantedView wanted = wanted_view(*rule, camera);
      if (!check_->has_targets(*rule)) group.impossible.push_back(rule->name + ".targets");
      for (std::size_t i = 0; i < wanted.bins.size(); ++i) {
        const Quota& quota = rule->quotas[i];
        const std::string key = rule->name + "." + quota.of;
        group.parts[key] = quota.bin_name(*wanted.bins[i]);
        if (quota.of != "label") continue;
        if (check_->has_label(*rule, quota.labels[*wanted.bins[i]])) continue;
        group.impossible.push_back(rule->name + ".quotas.label (no " +
                                   quota.labels[*wanted.bins[i]] + " here)");
        wanted.bins[i].reset();
      }
      if (check_->has_targets(*rule)) member.wanted.push_back(std::move(wanted));
    }
    group.members.push_back(std::move(member));
  }
}

void ViewSearch::run() {
  for (;;) {
    std::vector<Group*> pending;
    for (Group& group : groups_) {
      if (!group.is_done) pending.push_back(&group);
    }
    if (pending.empty()) return;
    setting_.host.stop_if_asked();
    const bool is_first = draws_ == 0;
    ++draws_;
    double seconds = 0.0;
    {
      const Stopwatch watch(seconds);
      if (!is_first) draw_anew(pending);
      judge(pending);
    }
    const auto refused =
        std::ranges::count_if(pending, [](const Group* group) { return !group->is_done; });
    refused_s_ += seconds * double(refused) / double(pending.size());
  }
}

/// What is not searched for stays as it is: other cameras, and all that is no camera.
void ViewSearch::draw_anew(const std::vector<Group*>& pending) {
  Scene& scene = setting_.scene;
  std::set<NodeId> moving;
  for (const Group* group : pending) moving.insert(group->tops.begin(), group->tops.end());
  std::vector<NodeId> all;
  std::vector<NodeId> staying;
  for (const NodeId camera : setting_.cameras) {
    const NodeId top = top_of(scene, camera);
    all.push_back(top);
    if (!moving.contains(top)) staying.push_back(top);
  }
  if (!others_) others_.emplace(scene, all);
  const SavedView stays(scene, staying);
  const std::uint64_t shapes = scene.shape_revision();
  setting_.redraw(draws_ - 1);
  stays.restore(scene);
  if (scene.shape_revision() == shapes) {
    others_->restore_poses(scene);
  } else {
    others_->restore(scene);
  }
}

void ViewSearch::judge(const std::vector<Group*>& pending) {
  std::vector<Group*> possible;
  for (Group* group : pending) {
    const ViewVerdict verdict = by_place(*group);
    if (verdict.holds()) {
      possible.push_back(group);
    } else {
      settle(*group, verdict);
    }
  }
  if (possible.empty()) return;
  for (const Group* group : possible) place_small_cameras(*group);
  prepare();
  std::vector<Group*> shown;
  for (Group* group : possible) {
    ViewVerdict verdict;
    for (std::size_t grid = 0; grid < kGridSteps.size() && verdict.holds(); ++grid) {
      verdict = by_grid(*group, grid);
    }
    if (verdict.holds()) verdict = by_labels(*group);
    if (verdict.holds()) {
      shown.push_back(group);
    } else {
      settle(*group, verdict);
    }
  }
  for (Group* group : shown) settle(*group, by_light(*group));
}

void ViewSearch::settle(Group& group, const ViewVerdict& verdict) {
  ++group.draws;
  if (verdict.holds()) {
    group.is_done = true;
    group.unmet = group.impossible;
    if (!group.unmet.empty()) end_at_limit(group);
    return;
  }
  ++group.refused[verdict.failed.front()];
  if (!group.best_verdict || verdict.shortfall < group.best_verdict->shortfall) {
    group.best_verdict = verdict;
    group.best = SavedView(setting_.scene, group.tops);
  }
  if (group.draws < group.max_tries && setting_.can_redraw) return;
  group.is_done = true;
  group.best.restore(setting_.scene);
  group.unmet = group.impossible;
  const std::vector<std::string>& failed = group.best_verdict->failed;
  group.unmet.insert(group.unmet.end(), failed.begin(), failed.end());
  end_at_limit(group);
  // It stays after all.
  const auto stays = group.refused.find(failed.front());
  if (--stays->second == 0) group.refused.erase(stays);
}

void ViewSearch::end_at_limit(Group& group) {
  std::string cameras;
  for (const Group::Member& member : group.members) {
    cameras += (cameras.empty() ? "" : ", ") + setting_.scene[setting_.cameras[member.camera]].name;
  }
  std::string text =
      "views: capture " + std::to_string(setting_.capture.index) + " (" + setting_.capture.phase +
      "), " + cameras + ": " + joined(group.unmet) + " not met in " + std::to_string(group.draws) +
      (group.draws == 1 ? " draw" : " draws") + limit_text(group.refused, group.draws);
  if (!setting_.can_redraw && !group.refused.empty()) {
    text += "; no randomizer places the camera at this capture, so it cannot be drawn anew";
  }
  if (!group.stops) {
    if (!setting_.is_passed) setting_.host.log(LogLevel::Warning, text);
    return;
  }
  throw Error(ErrorKind::Config,
              text + "; loosen that condition, raise 'max_tries' (" +
                  std::to_string(group.max_tries) +
                  "), let cameras be drawn from where it can hold, or keep the nearest view by "
                  "'at_limit: keep_best'");
}

ViewVerdict ViewSearch::by_place(const Group& group) const {
  ViewVerdict verdict;
  for (const Group::Member& member : group.members) {
    for (const WantedView& wanted : member.wanted) {
      verdict.add(check_->by_place(setting_.scene, setting_.cameras[member.camera], wanted));
    }
  }
  return verdict;
}

void ViewSearch::place_small_cameras(const Group& group) {
  Scene& scene = setting_.scene;
  for (const Group::Member& member : group.members) {
    const NodeId camera = setting_.cameras[member.camera];
    const std::vector<NodeId>& grids = setting_.small_cameras.of_labels.at(camera);
    for (std::size_t i = 0; i < grids.size(); ++i) {
      const std::optional<Camera> lens = sparser(*scene[camera].camera, kGridSteps[i]);
      if (!lens) continue;
      if (!are_equal(scene[grids[i]].camera, lens)) scene.edit(grids[i]).camera = lens;
      scene.set_pose(grids[i], scene.world_from_node(camera));
    }
  }
}

ViewVerdict ViewSearch::by_grid(const Group& group, std::size_t grid) {
  ViewVerdict verdict;
  for (const Group::Member& member : group.members) {
    const NodeId camera = setting_.cameras[member.camera];
    if (!sparser(*setting_.scene[camera].camera, kGridSteps[grid])) continue;
    verdict.add(by_labels_of(setting_.small_cameras.of_labels.at(camera)[grid], member.wanted,
                             kGridSteps[grid]));
    // One camera of a group that fails is enough.
    if (!verdict.holds()) break;
  }
  return verdict;
}

ViewVerdict ViewSearch::by_labels(const Group& group) {
  ViewVerdict verdict;
  for (const Group::Member& member : group.members) {
    verdict.add(by_labels_of(setting_.cameras[member.camera], member.wanted, 1));
    if (!verdict.holds()) break;
  }
  return verdict;
}

ViewVerdict ViewSearch::by_labels_of(NodeId camera, const std::vector<WantedView>& wanted,
                                     int step) {
  if (wanted.empty()) return {};
  ViewCheck::Labels labels;
  labels.step = step;
  labels.render = [&] { return render(camera, kLeafId.name).get(kLeafId); };
  labels.cover = [&](std::span<const LabelledInstance> instances) {
    return call_component("renderer '" + setting_.job.renderer.type + "'",
                          [&] { return setting_.renderer.cover(camera, instances); });
  };
  return check_->by_labels(setting_.scene, camera, wanted, labels);
}

ViewVerdict ViewSearch::by_light(const Group& group) {
  ViewVerdict verdict;
  Scene& scene = setting_.scene;
  for (const Group::Member& member : group.members) {
    for (const WantedView& wanted : member.wanted) {
      if (!wanted.rule->brightness.is_set()) continue;
      const NodeId camera = setting_.cameras[member.camera];
      const NodeId small = setting_.small_cameras.of_light.at(camera);
      const std::optional<Camera> lens = smaller(*scene[camera].camera);
      if (!are_equal(scene[small].camera, lens)) scene.edit(small).camera = lens;
      scene.set_pose(small, scene.world_from_node(camera));
      prepare();
      verdict.add(judge_brightness(*wanted.rule, render(small, kColor.name).get(kColor)));
    }
  }
  return verdict;
}

bool ViewSearch::needs_pictures() const {
  return std::ranges::any_of(rules_,
                             [](const ViewRule* rule) { return rule->brightness.is_set(); });
}

std::vector<std::size_t> ViewSearch::refuse_pictures(const std::vector<Frame>& frames) {
  std::vector<std::size_t> refused;
  for (Group& group : groups_) {
    if (!group.unmet.empty()) continue;
    ViewVerdict verdict;
    for (const Group::Member& member : group.members) {
      for (const WantedView& wanted : member.wanted) {
        if (!wanted.rule->brightness.is_set()) continue;
        verdict.add(judge_brightness(*wanted.rule, frames[member.camera].get(kColor)));
      }
    }
    if (verdict.holds()) continue;
    --group.draws;  // it is judged a second time
    group.is_done = false;
    settle(group, verdict);
    // A group at its limit may show another view, too.
    for (const Group::Member& member : group.members) refused.push_back(member.camera);
  }
  return refused;
}

Frame ViewSearch::render(NodeId camera, std::string_view channel) {
  RenderRequest request;
  request.camera = camera;
  request.channels = {std::string(channel)};
  request.seed = setting_.streams.render_seed(setting_.capture.index, setting_.scene[camera].name);
  return call_component("renderer '" + setting_.job.renderer.type + "'",
                        [&] { return setting_.renderer.render(request); });
}

void ViewSearch::prepare() {
  call_component("renderer '" + setting_.job.renderer.type + "'",
                 [&] { setting_.renderer.prepare(setting_.scene); });
}

std::vector<ViewOutcome> ViewSearch::outcomes() const {
  std::vector<ViewOutcome> outcomes;
  for (const Group& group : groups_) {
    for (const Group::Member& member : group.members) {
      outcomes.push_back({setting_.scene[setting_.cameras[member.camera]].name, group.draws,
                          group.refused, group.unmet, group.parts});
    }
  }
  return outcomes;
}

}  // namespace diorama
