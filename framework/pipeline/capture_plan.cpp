// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_plan.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "framework/host/asset_paths.h"
#include "framework/pipeline/label_pattern.h"

namespace diorama {
namespace {

/// Names of siblings, numbered like Scene::create() does it.
class SiblingNames {
 public:
  std::string free_name(const std::string& stem) {
    if (taken_.insert(stem).second) return stem;
    int& number = next_number_.try_emplace(stem, 1).first->second;
    for (;;) {
      char digits[16];
      std::snprintf(digits, sizeof digits, "_%02d", number++);
      if (const auto [name, is_new] = taken_.insert(stem + digits); is_new) return *name;
    }
  }

 private:
  std::set<std::string> taken_;
  std::map<std::string, int> next_number_;
};

/// What follows from the choice of an asset.
struct AssetWords {
  std::string stem;
  Labels labels;
};

AssetWords words_of(const ObjectGroup& group, const std::string& asset,
                    const std::optional<LabelPattern>& pattern) {
  AssetWords words{clean_name(asset_stem(asset)), {}};
  if (group.label) {
    words.labels = {{group.taxonomy, clean_name(*group.label)}};
  } else if (pattern) {
    const std::string label = pattern->replaced(words.stem, group.label_replacement);
    words.labels = {{group.taxonomy, clean_name(label)}};
  }
  return words;
}

/// Picks from a group's assets.
class Picks {
 public:
  Picks(const JobStreams& streams, const ObjectGroup& group, const std::vector<std::string>& assets)
      : streams_(streams), group_(group), assets_(assets) {}

  /// An index of `assets`. `rng` is the object's own stream, `number` counts the group's picks over
  /// all visits.
  std::size_t pick(Rng& rng, std::uint64_t number) {
    if (!group_.balance) return rng.index(assets_.size());
    shuffle(number / assets_.size());
    return order_[number % assets_.size()];
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
                int visit, std::map<std::string, SiblingNames>& names_below,
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
  std::optional<LabelPattern> pattern;
  if (group.label_pattern) pattern.emplace(*group.label_pattern);
  SiblingNames& names = names_below[group.under];
  std::map<std::size_t, AssetWords> words_of_asset;
  Picks picks(streams, group, assets);
  const std::uint64_t before = is_anew ? std::uint64_t(visit) * std::uint64_t(group.count) : 0;
  // What is left out is picked all the same, so that rounds stay rounds.
  const int count =
      group.count - int(streams.fewer(group.name, visit).index(std::size_t(group.fewer) + 1));
  for (int number = 0; number < count; ++number) {
    Rng rng = streams.object(group.name, number, is_anew ? visit : -1);
    PlannedObject object;
    object.group = index;
    const std::size_t choice = picks.pick(rng, before + std::uint64_t(number));
    object.asset = assets[choice];
    for (const auto& [set, names_of_set] : group.variant_sets) {
      Rng own = rng.fork("variants").fork(set);
      object.asset += "{" + set + "=" + names_of_set[own.index(names_of_set.size())] + "}";
    }
    object.floats = rng.chance(group.gravity_disabled_chance);
    const auto known = words_of_asset.find(choice);
    const AssetWords& words =
        known != words_of_asset.end()
            ? known->second
            : words_of_asset.emplace(choice, words_of(group, object.asset, pattern)).first->second;
    object.labels = words.labels;
    const std::string& word = object.labels.empty() ? words.stem : object.labels.begin()->second;
    object.name = names.free_name((object.floats ? "floating_" : "falling_") + node_name(word));
    object.path = group.under + "/" + object.name;
    objects.push_back(std::move(object));
  }
}

/// Captures, events or steps of that name in a visit that is not cut short; of a simulation until
/// rest as many steps as there may be.
std::int64_t moments_in(const std::vector<TimelineStep>& timeline, int rounds,
                        const std::string& moment) {
  std::int64_t count = 0;
  for (const TimelineStep& step : timeline) {
    const std::int64_t times = (std::int64_t(rounds) + step.every - 1) / step.every;
    if (step.kind == TimelineStep::Kind::Repeat) {
      count += times * moments_in(step.steps_of_round, step.rounds, moment);
    } else if (step.kind == TimelineStep::Kind::Simulate) {
      if (step.each_step == moment) count += times * step.steps;
    } else if (step.name == moment) {
      // A clip is one moment.
      count += times * (step.kind == TimelineStep::Kind::Capture ? step.count : 1);
    }
  }
  return count;
}

}  // namespace

CapturePlan::CapturePlan(const Job& job, std::vector<EnvironmentChoice> choices)
    : environments(std::move(choices)), capture_count_(job.total_captures) {
  std::map<std::string, std::int64_t> taken_of_series;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    if (step.count == 0) return true;
    const bool is_clip = step.kind == TimelineStep::Kind::Record;
    std::int64_t& taken = taken_of_series[step.name];
    if (!is_clip && !steps_.empty() && steps_.back().phase == step.name) {
      steps_.back().count += step.count;
    } else {
      steps_.push_back(
          {step.name, captures_per_visit_, step.count, taken, step.fps, clips_per_visit_});
    }
    taken += is_clip ? 1 : step.count;
    clips_per_visit_ += is_clip ? 1 : 0;
    captures_per_visit_ += step.count;
    return true;
  });
  if (captures_per_visit_ > 0 || capture_count_ == 0) return;
  throw Error(ErrorKind::Config, "timeline: no captures, so total_captures is never reached");
}

int CapturePlan::visit_count() const {
  if (capture_count_ == 0) return 0;
  return int((capture_count_ + captures_per_visit_ - 1) / captures_per_visit_);
}

PlannedVisit CapturePlan::visit(int index) const {
  PlannedVisit visit;
  visit.index = index;
  visit.environment = std::size_t(index) % environments.size();
  const std::int64_t first = index * captures_per_visit_;
  visit.first_capture = int(first);
  visit.capture_count = int(std::min<std::int64_t>(captures_per_visit_, capture_count_ - first));
  return visit;
}

PlannedCapture CapturePlan::capture(int index) const {
  const std::int64_t place = index % captures_per_visit_;
  const auto behind = std::upper_bound(steps_.begin(), steps_.end(), place,
                                       [](auto at, const Step& step) { return at < step.first; });
  const Step& step = *std::prev(behind);
  const std::int64_t number = place - step.first;
  if (step.fps == 0.0) return {index, step.phase, int(step.first_number + number), {}};
  const std::int64_t visit = index / captures_per_visit_;
  // The last clip of a job may be cut short.
  const std::int64_t left = capture_count_ - (index - number);
  ClipFrame clip;
  clip.clip = int(visit * clips_per_visit_ + step.clip);
  clip.frame = int(number);
  clip.frame_count = int(std::min(step.count, left));
  clip.fps = step.fps;
  return {index, step.phase, int(step.first_number), clip};
}

std::vector<PlannedSeries> CapturePlan::series(const PlannedVisit& visit) const {
  std::vector<PlannedSeries> list;
  for (const Step& step : steps_) {
    if (step.first >= visit.capture_count) break;
    const int count = int(std::min(step.count, visit.capture_count - step.first));
    if (step.fps > 0.0 || list.empty() || list.back().phase != step.phase) {
      list.push_back({step.phase, 0, step.fps});
    }
    list.back().count += count;
  }
  return list;
}

std::vector<DatasetClip> CapturePlan::clips() const {
  std::vector<DatasetClip> list;
  if (clips_per_visit_ == 0) return list;
  for (std::int64_t begin = 0; begin < capture_count_; begin += captures_per_visit_) {
    for (const Step& step : steps_) {
      const std::int64_t first = begin + step.first;
      if (step.fps == 0.0 || first >= capture_count_) continue;
      const auto count = std::min<std::int64_t>(step.count, capture_count_ - first);
      list.push_back({int(first), int(count), step.fps});
    }
  }
  return list;
}

CapturePlan plan_captures(const Job& job, std::vector<EnvironmentChoice> environments,
                          const std::vector<std::vector<std::string>>& object_assets) {
  CapturePlan plan(job, std::move(environments));
  plan.object_assets = object_assets;
  plan.objects = plan_objects(job, object_assets, 0);
  return plan;
}

std::vector<PlannedObject> plan_objects(const Job& job,
                                        const std::vector<std::vector<std::string>>& object_assets,
                                        int visit) {
  std::vector<PlannedObject> objects;
  std::map<std::string, SiblingNames> names_below;
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    plan_group(job, i, object_assets[i], visit, names_below, objects);
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
  for (int visit = 1; visit < plan.visit_count() && seen.size() < all.size(); ++visit) {
    for (const PlannedObject& object : plan_objects(job, plan.object_assets, visit)) {
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

std::optional<RandomizerCall> randomizer_call(const Job& job, const RandomizerEntry& entry,
                                              const std::string& moment, int visit, int number) {
  if (std::find(entry.on.begin(), entry.on.end(), moment) == entry.on.end()) return std::nullopt;
  if (moment == "environment") {
    return RandomizerCall{visit - visit % entry.every, visit / entry.every};
  }
  if (number % entry.every != 0) return std::nullopt;
  // Of more than fit, which no run gets to, the highest: nothing overflows.
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  const std::int64_t moments = moments_in(job.timeline, 1, moment);
  const std::int64_t calls_per_visit =
      std::min(kMost, moments / entry.every + (moments % entry.every != 0));
  const std::int64_t occurrence = visit * calls_per_visit + number / entry.every;
  return RandomizerCall{visit, int(std::min(kMost, occurrence))};
}

std::string asset_stem(std::string_view asset) {
  asset = split_variants(asset).first;
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

Rng JobStreams::fewer(std::string_view group, int visit) const {
  return root_.fork("fewer objects").fork(group).fork(std::uint64_t(visit));
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

Rng JobStreams::views(std::string_view rule, std::size_t quota) const {
  return root_.fork("views").fork(rule).fork(std::uint64_t(quota));
}

std::uint64_t JobStreams::render_seed(int capture, std::string_view camera) const {
  return root_.fork("render").fork(std::uint64_t(capture)).fork(camera).bits();
}

}  // namespace diorama
