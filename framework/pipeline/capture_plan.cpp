// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_plan.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <map>
#include <set>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
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

void plan_group(const Job& job, std::size_t index, const std::vector<std::string>& assets,
                std::map<std::string, SiblingNames>& names_below, CapturePlan& plan) {
  const ObjectGroup& group = job.objects[index];
  if (group.count == 0) return;
  if (assets.empty()) {
    throw Error(ErrorKind::Config, group.loader.map.place.text() + ": " + group.loader.path +
                                       ": names no assets, but " + std::to_string(group.count) +
                                       " objects are wanted");
  }
  const JobStreams streams(job.seed);
  std::optional<LabelPattern> pattern;
  if (group.label_pattern) pattern.emplace(*group.label_pattern);
  SiblingNames& names = names_below[group.under];
  std::map<std::size_t, AssetWords> words_of_asset;
  for (int number = 0; number < group.count; ++number) {
    Rng rng = streams.object(group.name, number);
    PlannedObject object;
    object.group = index;
    const std::size_t choice = rng.index(assets.size());
    object.asset = assets[choice];
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
    plan.objects.push_back(std::move(object));
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

}  // namespace

CapturePlan::CapturePlan(const Job& job, std::vector<EnvironmentChoice> choices)
    : environments(std::move(choices)), capture_count_(job.total_captures) {
  std::map<std::string, std::int64_t> taken_of_series;
  for (const TimelineStep& step : job.timeline) {
    if (step.count == 0) continue;
    std::int64_t& taken = taken_of_series[step.name];
    steps_.push_back({step.name, captures_per_visit_, step.count, taken});
    taken += step.count;
    captures_per_visit_ += step.count;
  }
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
  return {index, step.phase, int(step.first_number + place - step.first)};
}

std::vector<PlannedSeries> CapturePlan::series(const PlannedVisit& visit) const {
  std::vector<PlannedSeries> list;
  for (const Step& step : steps_) {
    if (step.first >= visit.capture_count) break;
    const int count = int(std::min(step.count, visit.capture_count - step.first));
    if (list.empty() || list.back().phase != step.phase) list.push_back({step.phase, 0});
    list.back().count += count;
  }
  return list;
}

CapturePlan plan_captures(const Job& job, std::vector<EnvironmentChoice> environments,
                          const std::vector<std::vector<std::string>>& object_assets) {
  CapturePlan plan(job, std::move(environments));
  std::map<std::string, SiblingNames> names_below;
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    plan_group(job, i, object_assets[i], names_below, plan);
  }
  return plan;
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

Rng JobStreams::object(std::string_view group, int number) const {
  return root_.fork("objects").fork(group).fork(std::uint64_t(number));
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
