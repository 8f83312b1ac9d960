// SPDX-License-Identifier: Apache-2.0
#include "value_clips.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "error.h"
#include "path.h"
#include "stage.h"

namespace diorama::usd {
namespace {

// A template of more files than this is none.
constexpr double kMostClips = 100'000.0;

const Value* find(const Dictionary& dictionary, std::string_view key) {
  const auto found = dictionary.find(key);
  return found == dictionary.end() ? nullptr : &found->second;
}

double number_or(const Dictionary& dictionary, std::string_view key, double fallback) {
  const Value* value = find(dictionary, key);
  return value ? value->as_number().value_or(fallback) : fallback;
}

// Pairs of a stage time and what belongs to it, by time; those of the same time as they stand.
using TimePairs = std::vector<std::pair<double, double>>;

TimePairs pairs_of(const Dictionary& dictionary, std::string_view key) {
  TimePairs pairs;
  const Value* value = find(dictionary, key);
  const auto list = value ? numbers<double>(*value, 2) : std::nullopt;
  for (std::size_t i = 0; list && i + 1 < list->span.size(); i += 2) {
    const double time = list->span[i];
    const double other = list->span[i + 1];
    if (std::isfinite(time) && std::isfinite(other)) pairs.emplace_back(time, other);
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  return pairs;
}

// The last pair that is not later than the time; the first one where all are.
TimePairs::const_iterator pair_at(const TimePairs& pairs, double time) {
  const auto later = std::upper_bound(pairs.begin(), pairs.end(), time,
                                      [](double t, const auto& pair) { return t < pair.first; });
  return later == pairs.begin() ? later : later - 1;
}

// Runs through the pairs in straight lines.
double clip_time(const TimePairs& times, double stage_time) {
  if (times.empty()) return stage_time;
  const auto before = pair_at(times, stage_time);
  const auto after = before + 1;
  const double elapsed = stage_time - before->first;
  if (elapsed < 0.0 || after == times.end() || after->first <= before->first) return before->second;
  return before->second +
         elapsed * (after->second - before->second) / (after->first - before->first);
}

// `clip.###.usd` at 7 is `clip.007.usd`; a second group of # holds what is behind the point.
std::optional<std::string> fill_template(const std::string& pattern, double time) {
  const std::size_t first = pattern.find('#');
  if (first == std::string::npos) return std::nullopt;
  const std::size_t first_end = std::min(pattern.find_first_not_of('#', first), pattern.size());
  const std::size_t second = pattern.find('#', first_end);
  const std::size_t second_end =
      second == std::string::npos
          ? second
          : std::min(pattern.find_first_not_of('#', second), pattern.size());
  const auto padded = [](double number, std::size_t width) {
    std::string digits = std::to_string(static_cast<long long>(number));
    if (digits.size() < width) digits.insert(0, width - digits.size(), '0');
    return digits;
  };
  if (second == std::string::npos) {
    return pattern.substr(0, first) + padded(std::floor(time), first_end - first) +
           pattern.substr(first_end);
  }
  const std::size_t places = second_end - second;
  const double scale = std::pow(10.0, static_cast<double>(places));
  const double fine = std::round(time * scale);
  const double whole = std::floor(fine / scale);
  return pattern.substr(0, first) + padded(whole, first_end - first) +
         pattern.substr(first_end, second - first_end) + padded(fine - whole * scale, places) +
         pattern.substr(second_end);
}

}  // namespace

// One clip set as it is at the time that counts.
struct ValueClips::ClipSet {
  std::string name;
  const LayerStack* stack = nullptr;
  const Layer* layer = nullptr;  ///< That names the assets.
  std::string node_path;         ///< Of the node that they stand in, without variants.
  LayerOffset to_stage;          ///< From the times of that layer.
  std::string prim_path;
  std::string asset;  ///< As written; empty: no clip is active.
  double time = 0.0;  ///< Of the clip.
  double stage_time = 0.0;
  TimePairs times;  ///< From stage times to those of clips; empty: they are the same.
  /// The clip that comes after it.
  struct Next {
    std::string asset;
    double stage_time = 0.0;  ///< When it begins.
  };
  std::optional<Next> next;
};

/// What a clip's layer says of an attribute.
struct ValueClips::Said {
  std::shared_ptr<const Layer> layer;
  const PropertySpec* property = nullptr;
  Value samples;
};

namespace {

// When the clip that is active at a stage time showed one of its own times, as far back as the
// mapping runs straight.
double stage_time_of(const TimePairs& times, double stage_time, double clip_time) {
  if (times.empty()) return clip_time;
  const auto before = pair_at(times, stage_time);
  const auto after = before + 1;
  if (after == times.end() || after->second == before->second) return before->first;
  const double share = (clip_time - before->second) / (after->second - before->second);
  return std::clamp(before->first + share * (after->first - before->first), before->first,
                    std::max(before->first, stage_time));
}

// The time that counts, or when the stage starts, in the time of a layer.
std::optional<double> start_time(const Layer& root, const LayerOffset& to_stage,
                                 std::optional<double> time) {
  const auto start = time ? time : root.get(root.root(), "startTimeCode").as_number();
  if (!start || !std::isfinite(*start) || to_stage.scale == 0.0) return std::nullopt;
  return (*start - to_stage.offset) / to_stage.scale;
}

}  // namespace

ValueClips::ValueClips(AssetLibrary& assets, const LayerStacks& stacks, Diagnostics& diagnostics,
                       const Layer& root, std::optional<double> time)
    : assets_(assets), stacks_(stacks), diagnostics_(diagnostics), root_(root), time_(time) {}

ValueClips::~ValueClips() = default;

void ValueClips::read_explicit(ClipSet& set, const Dictionary& fields) {
  const Value* assets = usd::find(fields, "assetPaths");
  const TimePairs active = pairs_of(fields, "active");
  const TimePairs times = pairs_of(fields, "times");
  double time = 0.0;
  if (!active.empty()) time = active.front().first;
  time = start_time(root_, set.to_stage, time_).value_or(time);
  const Strings& names = *assets->as_strings();
  const auto name_of = [&](double number) {
    const bool exists = number >= 0.0 && number < static_cast<double>(names.size());
    return exists ? names[static_cast<std::size_t>(number)] : std::string();
  };
  set.asset = name_of(0.0);
  if (!active.empty()) {
    const auto now = pair_at(active, time);
    set.asset = name_of(now->second);
    if (now + 1 != active.end() && (now + 1)->first > time) {
      set.next = {name_of((now + 1)->second), (now + 1)->first};
    }
  }
  set.time = clip_time(times, time);
  set.stage_time = time;
  set.times = times;
}

// Of a template the files that are there count.
bool ValueClips::read_template(ClipSet& set, const Dictionary& fields) {
  const Value* value = usd::find(fields, "templateAssetPath");
  const std::string* pattern = value ? value->as_text() : nullptr;
  const double first = number_or(fields, "templateStartTime", NAN);
  const double last = number_or(fields, "templateEndTime", NAN);
  const double stride = number_or(fields, "templateStride", NAN);
  const bool is_sound = pattern && std::isfinite(first) && last >= first && stride > 0.0 &&
                        (last - first) / stride < kMostClips;
  if (!is_sound) return false;
  const double offset = number_or(fields, "templateActiveOffset", 0.0);
  const double time = start_time(root_, set.to_stage, time_).value_or(first);
  const double most = std::floor((last - first) / stride + 1e-9);
  const double wanted = std::clamp(std::floor((time - offset - first) / stride), 0.0, most);
  const auto asset_at = [&](double number) {
    auto asset = fill_template(*pattern, first + number * stride).value_or("");
    const std::string file = stacks_.anchor(asset, *set.layer, set.stack->expression_variables);
    return assets_.exists(file) ? asset : std::string();
  };
  for (double number = wanted; number >= 0.0 && set.asset.empty(); --number) {
    set.asset = asset_at(number);
  }
  for (double number = wanted + 1.0; number <= most; ++number) {
    const std::string later = asset_at(number);
    if (later.empty()) continue;
    if (!set.asset.empty()) {
      set.next = {later, first + number * stride + offset};
      break;
    }
    set.asset = later;
  }
  set.time = set.stage_time = time;
  return !set.asset.empty();
}

std::vector<ValueClips::ClipSet> ValueClips::read_sets(const Prim& prim) {
  // Weak dictionaries are merged under strong ones, set by set and key by key; whoever names the
  // assets is who they are relative to.
  std::map<std::string, Dictionary> merged;
  std::map<std::string, const Opinion*> origins;
  for (auto opinion = prim.opinions.rbegin(); opinion != prim.opinions.rend(); ++opinion) {
    const Value clips = opinion->entry->layer->get(*opinion->spec, "clips");
    if (!clips.as_dictionary()) continue;
    for (const auto& [name, set] : *clips.as_dictionary()) {
      if (!set.as_dictionary()) continue;
      for (const auto& [key, value] : *set.as_dictionary()) {
        merged[name].insert_or_assign(key, value);
        if (key == "assetPaths" || key == "templateAssetPath") origins[name] = &*opinion;
      }
    }
  }
  std::vector<ClipSet> sets;
  for (const auto& [name, fields] : merged) {
    const std::string where = "the value clips '" + name + "' of <" + prim.path + ">";
    const Value* path = usd::find(fields, "primPath");
    const auto origin = origins.find(name);
    const bool is_named = origin != origins.end() && path && path->as_text() &&
                          path->as_text()->starts_with('/') && path::is_prim_path(*path->as_text());
    if (!is_named) {
      diagnostics_.warn(root_.identifier() + ": " + where +
                        " name no assets or no prim in them, so they are not read");
      continue;
    }
    ClipSet set;
    set.name = name;
    set.stack = origin->second->node->stack;
    set.layer = origin->second->entry->layer.get();
    set.node_path = path::strip_variants(origin->second->node->path);
    set.to_stage =
        origin->second->node->map_to_root->offset().compose(origin->second->entry->offset);
    set.prim_path = *path->as_text();
    const Value* assets = usd::find(fields, "assetPaths");
    if (assets && assets->as_strings() && !assets->as_strings()->empty()) {
      read_explicit(set, fields);
    } else if (!read_template(set, fields)) {
      const std::string text =
          set.layer->identifier() + ": " + where + " lead to no file, so they are not read";
      diagnostics_.missing(text, text);
      continue;
    }
    if (!set.asset.empty()) sets.push_back(std::move(set));
  }
  return sets;
}

const std::vector<ValueClips::ClipSet>& ValueClips::sets_of(const Prim& prim) {
  const auto known = sets_.find(&prim);
  if (known != sets_.end()) return known->second;
  return sets_.emplace(&prim, read_sets(prim)).first->second;
}

std::shared_ptr<const Layer> ValueClips::open(const std::string& asset, const ClipSet& set) {
  const std::string identifier = stacks_.anchor(asset, *set.layer, set.stack->expression_variables);
  const std::string where = set.layer->identifier() + ": value clip @" + asset + "@";
  try {
    if (assets_.exists(identifier)) return assets_.open(identifier);
    diagnostics_.missing(identifier, where + " " + assets_.missing_text(identifier));
  } catch (const FormatError& error) {
    diagnostics_.missing(identifier, where + " could not be read: " + error.what());
  }
  return nullptr;
}

ValueClips::Said ValueClips::said_in(const std::string& asset, const ClipSet& set,
                                     const std::string& path, std::string_view attribute) {
  Said said;
  said.layer = asset.empty() ? nullptr : open(asset, set);
  const PrimSpec* spec = said.layer ? said.layer->prim(path) : nullptr;
  said.property = spec ? spec->property(attribute) : nullptr;
  if (said.property) said.samples = said.layer->get(said.property->fields, "timeSamples");
  const TimeSamples* samples = said.samples.as_time_samples();
  if (!samples || samples->times.empty()) said.property = nullptr;
  return said;
}

FoundValue ValueClips::find(const Prim& prim, std::string_view attribute,
                            const IndexNode** anchor) {
  for (const Prim* at = &prim; at && at->has_clips; at = at->parent) {
    for (const ClipSet& set : sets_of(*at)) {
      const std::string path = path::replace_prefix(prim.path, at->path, set.prim_path);
      const Said said = said_in(set.asset, set, path, attribute);
      if (!said.property) continue;
      const TimeSamples& samples = *said.samples.as_time_samples();
      Value value = value_at(samples, set.time);
      if (set.next && set.time > samples.times.back()) {
        const double from = stage_time_of(set.times, set.stage_time, samples.times.back());
        const Said next = said_in(set.next->asset, set, path, attribute);
        if (next.property && from < set.next->stage_time) {
          const double begin = clip_time(set.times, set.next->stage_time);
          value = blended(value, value_at(*next.samples.as_time_samples(), begin),
                          (set.stage_time - from) / (set.next->stage_time - from));
        }
      }
      if (anchor) {
        const std::string site = set.node_path + prim.path.substr(at->path.size());
        for (const IndexNode& node : prim.index.nodes) {
          if (*anchor || node.stack != set.stack) continue;
          if (path::strip_variants(node.path) == site) *anchor = &node;
        }
      }
      auto& known = timed_[{said.property, set.time}];
      if (!known) known = std::make_unique<PropertySpec>(*said.property);
      return {std::move(value), said.layer.get(), set.stack, known.get()};
    }
  }
  return {};
}

}  // namespace diorama::usd
