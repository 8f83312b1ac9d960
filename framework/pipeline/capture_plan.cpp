// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_plan.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <numeric>
#include <regex>
#include <set>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

Labels labels_of(const ObjectGroup& group, const std::string& stem) {
  if (group.label) return {{group.taxonomy, *group.label}};
  if (!group.label_pattern) return {};
  const std::regex pattern(*group.label_pattern, std::regex::ECMAScript);
  return {{group.taxonomy, std::regex_replace(stem, pattern, group.label_replacement)}};
}

/// Numbered like Scene::create() does it.
std::string free_name(const std::string& stem, std::set<std::string>& taken) {
  std::string name = stem;
  for (int number = 1; !taken.insert(name).second; ++number) {
    char digits[16];
    std::snprintf(digits, sizeof digits, "_%02d", number);
    name = stem + digits;
  }
  return name;
}

/// Picks from a group's assets.
class Picks {
 public:
  Picks(const JobStreams& streams, const ObjectGroup& group, const std::vector<std::string>& assets)
      : streams_(streams), group_(group), assets_(assets) {}

  /// `rng` is the object's own stream, `number` counts the group's picks over all visits.
  const std::string& pick(Rng& rng, std::uint64_t number) {
    if (!group_.balance) return assets_[rng.index(assets_.size())];
    shuffle(number / assets_.size());
    return assets_[order_[number % assets_.size()]];
  }

 private:
  void shuffle(std::uint64_t round) {
    if (!order_.empty() && round == round_) return;
    round_ = round;
    order_.resize(assets_.size());
    std::iota(order_.begin(), order_.end(), std::size_t(0));
    Rng rng = streams_.round(group_.name, round);
    for (std::size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[rng.index(i)]);
  }

  const JobStreams& streams_;
  const ObjectGroup& group_;
  const std::vector<std::string>& assets_;
  std::uint64_t round_ = 0;
  std::vector<std::size_t> order_;
};

bool picks_per_visit(const ObjectGroup& group) {
  return group.pick == "per_visit" && group.count > 0;
}

void plan_group(const Job& job, std::size_t index, const std::vector<std::string>& assets,
                int visit, std::map<std::string, std::set<std::string>>& taken_below,
                std::vector<PlannedObject>& objects) {
  const ObjectGroup& group = job.objects[index];
  if (group.count == 0) return;
  if (assets.empty()) {
    throw Error(ErrorKind::Config, group.loader.map.place.text() + ": " + group.loader.path +
                                       ": names no assets, but " + std::to_string(group.count) +
                                       " objects are wanted");
  }
  const bool is_anew = picks_per_visit(group);
  const JobStreams streams(job.seed);
  Picks picks(streams, group, assets);
  const std::uint64_t before = is_anew ? std::uint64_t(visit) * std::uint64_t(group.count) : 0;
  for (int number = 0; number < group.count; ++number) {
    Rng rng = streams.object(group.name, number, is_anew ? visit : -1);
    PlannedObject object;
    object.group = index;
    object.asset = picks.pick(rng, before + std::uint64_t(number));
    object.floats = rng.chance(group.gravity_disabled_chance);
    const std::string stem = asset_stem(object.asset);
    object.labels = labels_of(group, stem);
    const std::string& word = object.labels.empty() ? stem : object.labels.begin()->second;
    object.name = free_name((object.floats ? "floating_" : "falling_") + node_name(word),
                            taken_below[group.under]);
    object.path = group.under + "/" + object.name;
    objects.push_back(std::move(object));
  }
}

/// Captures or events of that name in a visit that is not cut short.
int moments_per_visit(const Job& job, const std::string& moment) {
  int count = 0;
  for (const TimelineStep& step : job.timeline) {
    if (step.name != moment) continue;
    count += step.kind == TimelineStep::Kind::Capture ? step.count : 1;
  }
  return count;
}

PlannedVisit plan_visit(const Job& job, int visit, int first_capture) {
  PlannedVisit planned;
  planned.index = visit;
  std::map<std::string, int> taken_of_series;
  for (const TimelineStep& step : job.timeline) {
    for (int i = 0; i < step.count; ++i) {
      const int index = first_capture + int(planned.captures.size());
      if (index >= job.total_captures) return planned;
      planned.captures.push_back({index, step.name, taken_of_series[step.name]++});
    }
  }
  return planned;
}

}  // namespace

int CapturePlan::capture_count() const {
  int count = 0;
  for (const PlannedVisit& visit : visits) count += int(visit.captures.size());
  return count;
}

CapturePlan plan_captures(const Job& job, std::vector<EnvironmentChoice> environments,
                          const std::vector<std::vector<std::string>>& object_assets) {
  CapturePlan plan;
  plan.environments = std::move(environments);
  plan.object_assets = object_assets;
  plan.objects = plan_objects(job, object_assets, 0);
  int captures = 0;
  while (captures < job.total_captures) {
    PlannedVisit visit = plan_visit(job, int(plan.visits.size()), captures);
    if (visit.captures.empty()) {
      throw Error(ErrorKind::Config, "timeline: no captures, so total_captures is never reached");
    }
    visit.environment = plan.visits.size() % plan.environments.size();
    captures += int(visit.captures.size());
    plan.visits.push_back(std::move(visit));
  }
  return plan;
}

std::vector<PlannedObject> plan_objects(const Job& job,
                                        const std::vector<std::vector<std::string>>& object_assets,
                                        int visit) {
  std::vector<PlannedObject> objects;
  std::map<std::string, std::set<std::string>> taken_below;
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    plan_group(job, i, object_assets[i], visit, taken_below, objects);
  }
  return objects;
}

void visit_planned_objects(const Job& job, const CapturePlan& plan,
                           const std::function<void(const PlannedObject&)>& body) {
  using Asset = std::pair<std::size_t, std::string>;  // with its group
  std::set<Asset> all;                                // a list may name one twice
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    if (!picks_per_visit(job.objects[i])) continue;
    for (const std::string& asset : plan.object_assets[i]) all.emplace(i, asset);
  }
  std::set<Asset> seen;
  const auto look_at = [&](const PlannedObject& object) {
    body(object);
    if (picks_per_visit(job.objects[object.group])) seen.emplace(object.group, object.asset);
  };
  for (const PlannedObject& object : plan.objects) look_at(object);
  for (std::size_t visit = 1; visit < plan.visits.size() && seen.size() < all.size(); ++visit) {
    for (const PlannedObject& object : plan_objects(job, plan.object_assets, int(visit))) {
      look_at(object);
    }
  }
}

std::vector<std::vector<std::string>> unused_assets(const Job& job, const CapturePlan& plan) {
  std::vector<std::set<std::string>> used(job.objects.size());
  visit_planned_objects(
      job, plan, [&](const PlannedObject& object) { used[object.group].insert(object.asset); });
  std::vector<std::vector<std::string>> unused(job.objects.size());
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    if (job.objects[i].count == 0) continue;
    for (const std::string& asset : plan.object_assets[i]) {
      if (!used[i].contains(asset)) unused[i].push_back(asset);
    }
  }
  return unused;
}

std::vector<PlannedVisit> shard_of(const CapturePlan& plan, int shard, int shards) {
  std::vector<PlannedVisit> visits;
  for (const PlannedVisit& visit : plan.visits) {
    if (visit.index % shards == shard) visits.push_back(visit);
  }
  return visits;
}

std::optional<RandomizerCall> randomizer_call(const Job& job, const RandomizerEntry& entry,
                                              const std::string& moment, int visit, int number) {
  if (std::find(entry.on.begin(), entry.on.end(), moment) == entry.on.end()) return std::nullopt;
  if (moment == "environment") {
    return RandomizerCall{visit - visit % entry.every, visit / entry.every};
  }
  if (number % entry.every != 0) return std::nullopt;
  const int calls_per_visit = (moments_per_visit(job, moment) + entry.every - 1) / entry.every;
  return RandomizerCall{visit, visit * calls_per_visit + number / entry.every};
}

std::string asset_stem(std::string_view asset) {
  const std::size_t start = asset.find_last_of("/:");
  std::string_view name = start == std::string_view::npos ? asset : asset.substr(start + 1);
  const std::size_t dot = name.find_last_of('.');
  if (dot != std::string_view::npos && dot > 0) name = name.substr(0, dot);
  return std::string(name);
}

Rng JobStreams::object(std::string_view group, int number, int visit) const {
  const Rng stream = root_.fork("objects").fork(group).fork(std::uint64_t(number));
  return visit < 0 ? stream : stream.fork("visit").fork(std::uint64_t(visit));
}

Rng JobStreams::round(std::string_view group, std::uint64_t number) const {
  return root_.fork("rounds").fork(group).fork(number);
}

Rng JobStreams::randomizer(std::string_view name, int visit, std::string_view moment,
                           int occurrence) const {
  return root_.fork("randomizers")
      .fork(name)
      .fork(std::uint64_t(visit))
      .fork(moment)
      .fork(std::uint64_t(std::int64_t(occurrence)));
}

std::uint64_t JobStreams::render_seed(int capture, std::string_view camera) const {
  return root_.fork("render").fork(std::uint64_t(capture)).fork(camera).bits();
}

}  // namespace diorama
