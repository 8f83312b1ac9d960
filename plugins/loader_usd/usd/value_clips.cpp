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

/// The times of a template, from file to file.
struct ClipTemplate {
  const std::string* pattern = nullptr;
  double first = 0.0;
  double stride = 1.0;
  double last = 0.0;

  double count() const { return std::floor((last - first) / stride + 1e-9) + 1.0; }
};

namespace {

// A template of more files than this is none.
constexpr double kMostClips = 100'000.0;
// Nor one whose numbers are longer.
constexpr double kMostTime = 1e15;

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

// Of two pairs of one time the first holds until just before it: time jumps there. As long as
// OpenUSD's step, and above the rounding of times of days in frames.
constexpr double kBeforeJump = 1e-8;

TimePairs with_jumps(TimePairs times) {
  for (std::size_t i = 0; i + 1 < times.size(); ++i) {
    if (times[i].first == times[i + 1].first) times[i].first -= kBeforeJump;
  }
  return times;
}

// The straight piece of a mapping that a stage time is in.
struct Piece {
  double stage = 0.0;
  double clip = 0.0;
  double speed = 0.0;  ///< 0 before the first pair and from the last one on.

  double clip_time(double stage_time) const { return clip + (stage_time - stage) * speed; }
};

// Without pairs both times are the same.
Piece piece_at(const TimePairs& times, double stage_time) {
  if (times.empty()) return {0.0, 0.0, 1.0};
  const auto before = pair_at(times, stage_time);
  const auto after = before + 1;
  const bool is_outside = stage_time < before->first || after == times.end();
  if (is_outside || after->first <= before->first) return {before->first, before->second, 0.0};
  return {before->first, before->second,
          (after->second - before->second) / (after->first - before->first)};
}

double clip_time(const TimePairs& times, double stage_time) {
  return piece_at(times, stage_time).clip_time(stage_time);
}

// When clips are shown that are active from `begin` until `end`.
struct Span {
  double begin = 0.0;
  double end = 0.0;
};

// The last stage time that a clip says something of, for a time within its span: a sample's, a
// pair's of the mapping, its begin. Infinity if it says more later.
double last_said(const TimePairs& times, const TimeSamples* samples, double time,
                 const Span& span) {
  if (time < span.begin) return INFINITY;
  double last = span.begin;
  const auto say = [&](double stage_time) {
    if (stage_time <= time) last = std::max(last, stage_time);
    return stage_time <= time || stage_time >= span.end;
  };
  const auto later = std::upper_bound(times.begin(), times.end(), time,
                                      [](double t, const auto& pair) { return t < pair.first; });
  if (later != times.end() && !say(later->first)) return INFINITY;
  if (later != times.begin()) say((later - 1)->first);
  const Piece piece = piece_at(times, time);
  if (!samples || piece.speed == 0.0) return last;
  const std::vector<double>& said = samples->times;
  const auto next = std::upper_bound(said.begin(), said.end(), piece.clip_time(time));
  const auto stage_time = [&](double at) { return piece.stage + (at - piece.clip) / piece.speed; };
  if (next != said.end() && !say(stage_time(*next))) return INFINITY;
  if (next != said.begin() && !say(stage_time(*(next - 1)))) return INFINITY;
  return last;
}

// `clip.###.usd` at 7 is `clip.007.usd`; a second group of # holds what is behind the point.
std::string fill_template(const std::string& pattern, double time) {
  const std::size_t first = pattern.find('#');
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

// Nothing where it is none.
std::optional<ClipTemplate> template_of(const Dictionary& fields) {
  const Value* value = find(fields, "templateAssetPath");
  ClipTemplate result;
  result.pattern = value ? value->as_text() : nullptr;
  result.first = number_or(fields, "templateStartTime", NAN);
  result.last = number_or(fields, "templateEndTime", NAN);
  result.stride = number_or(fields, "templateStride", NAN);
  const bool is_sound = result.pattern && result.pattern->find('#') != std::string::npos &&
                        std::abs(result.first) < kMostTime && result.last >= result.first &&
                        std::abs(result.last) < kMostTime && result.stride > 0.0 &&
                        (result.last - result.first) / result.stride < kMostClips;
  return is_sound ? std::optional(result) : std::nullopt;
}

}  // namespace

// One clip set, and the time that counts.
struct ValueClips::ClipSet {
  struct Clip {
    double begin = 0.0;  ///< In stage time.
    std::string asset;   ///< As written; empty: there is none.
  };
  std::string name;
  const LayerStack* stack = nullptr;
  const Layer* layer = nullptr;  ///< That names the assets.
  std::string node_path;         ///< Of the node that they stand in, without variants.
  LayerOffset to_stage;          ///< From the times of that layer.
  std::string prim_path;
  std::string manifest;  ///< As written; empty: what the clips say counts.
  bool bridges_gaps = false;
  std::vector<Clip> clips;  ///< One at least, by their begins; the first holds before, too.
  TimePairs times;          ///< From stage times to those of clips; empty: they are the same.
  double time = 0.0;        ///< Of the stage, as all times here in that of the layer.

  std::size_t active() const {
    const auto later = std::upper_bound(clips.begin(), clips.end(), time,
                                        [](double t, const Clip& clip) { return t < clip.begin; });
    return later == clips.begin() ? 0 : static_cast<std::size_t>(later - clips.begin()) - 1;
  }
  Span span(std::size_t clip) const {
    return {clips[clip].begin, clip + 1 < clips.size() ? clips[clip + 1].begin : INFINITY};
  }
};

/// What a clip's layer says of an attribute.
struct ValueClips::Said {
  std::shared_ptr<const Layer> layer;
  const PropertySpec* property = nullptr;
  Value samples;

  const TimeSamples* list() const { return property ? samples.as_time_samples() : nullptr; }
};

/// What a set has for an attribute.
struct ValueClips::Answer {
  Value value;  ///< Empty: the set is not about the attribute.
  std::shared_ptr<const Layer> layer;
  const PropertySpec* property = nullptr;
  bool is_between = false;  ///< Two clips, or a clip and what stands in for one.
};

namespace {

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
  const Strings& names = *usd::find(fields, "assetPaths")->as_strings();
  set.times = with_jumps(pairs_of(fields, "times"));
  for (const auto& [begin, number] : pairs_of(fields, "active")) {
    const bool exists = number >= 0.0 && number < static_cast<double>(names.size());
    set.clips.push_back({begin, exists ? names[static_cast<std::size_t>(number)] : std::string()});
  }
  if (set.clips.empty()) set.clips.push_back({0.0, names.front()});
  set.time = start_time(root_, set.to_stage, time_).value_or(set.clips.front().begin);
}

// Of the files of a template that are there. Members of a crowd share one.
const std::vector<double>& ValueClips::times_of(const ClipSet& set, const ClipTemplate& files) {
  const TemplateKey key{set.layer,   set.stack,  *files.pattern,
                        files.first, files.last, files.stride};
  const auto [known, is_new] = templates_.try_emplace(key);
  std::vector<double>& times = known->second;
  for (double number = 0.0; is_new && number < files.count(); ++number) {
    const double time = files.first + number * files.stride;
    const std::string asset = fill_template(*files.pattern, time);
    const bool is_there =
        assets_.exists(stacks_.anchor(asset, *set.layer, set.stack->expression_variables));
    if (is_there) times.push_back(time);
  }
  return times;
}

// Of a template the files that are there count, and each is a pair of the mapping.
bool ValueClips::read_template(ClipSet& set, const Dictionary& fields) {
  const std::optional<ClipTemplate> files = template_of(fields);
  if (!files) return false;
  double offset = number_or(fields, "templateActiveOffset", 0.0);
  if (!std::isfinite(offset)) offset = 0.0;
  for (const double time : times_of(set, *files)) {
    set.clips.push_back({time + offset, fill_template(*files->pattern, time)});
    set.times.emplace_back(time, time);
  }
  if (set.clips.empty()) return false;
  if (offset != 0.0) {
    const double before = files->first - std::abs(offset);
    const double after = files->last + std::abs(offset);
    set.times.insert(set.times.begin(), {before, before});
    set.times.emplace_back(after, after);
  }
  set.time = start_time(root_, set.to_stage, time_).value_or(set.clips.front().begin);
  return true;
}

// By name, or as `clipSets` lists them, which may leave some out.
void ValueClips::in_order(const Prim& prim, std::vector<ClipSet>& sets) {
  Strings names;
  for (const ClipSet& set : sets) names.push_back(set.name);
  const Strings by_name = names;
  for (auto opinion = prim.opinions.rbegin(); opinion != prim.opinions.rend(); ++opinion) {
    const Value edits = opinion->entry->layer->get(*opinion->spec, "clipSets");
    if (edits.as_string_list_op()) edits.as_string_list_op()->apply(names);
  }
  if (names == by_name) return;
  std::vector<ClipSet> ordered;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(sets, name, &ClipSet::name);
    if (found != sets.end()) ordered.push_back(*found);
  }
  sets = std::move(ordered);
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
    const Value* manifest = usd::find(fields, "manifestAssetPath");
    if (manifest && manifest->as_text()) set.manifest = *manifest->as_text();
    const Value* bridges = usd::find(fields, "interpolateMissingClipValues");
    set.bridges_gaps = bridges && bridges->as_bool().value_or(false);
    const Value* assets = usd::find(fields, "assetPaths");
    if (assets && assets->as_strings() && !assets->as_strings()->empty()) {
      read_explicit(set, fields);
    } else if (!read_template(set, fields)) {
      const std::string text =
          set.layer->identifier() + ": " + where + " lead to no file, so they are not read";
      diagnostics_.missing(text, text);
      continue;
    }
    sets.push_back(std::move(set));
  }
  in_order(prim, sets);
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
  const TimeSamples* samples = said.list();
  if (!samples || samples->times.empty()) said.property = nullptr;
  return said;
}

// Without a manifest what the active clip leaves out is not the set's: else every clip would have
// to be opened for every attribute that none of them mentions.
ValueClips::Answer ValueClips::answer_of(const ClipSet& set, const std::string& path,
                                         std::string_view attribute) {
  const std::shared_ptr<const Layer> manifest =
      set.manifest.empty() ? nullptr : open(set.manifest, set);
  const PropertySpec* declared = nullptr;
  Value fallback;
  if (manifest) {
    const PrimSpec* spec = manifest->prim(path);
    declared = spec ? spec->property(attribute) : nullptr;
    if (!declared) return {};
    fallback = manifest->get(declared->fields, "default");
  }
  const Value blocks = declared ? manifest->get(declared->fields, "timeSamples") : Value();
  const auto said_by = [&](std::size_t clip) {
    const TimeSamples* list = set.bridges_gaps ? blocks.as_time_samples() : nullptr;
    const double begin = set.clips[clip].begin;
    const bool has_word = list && std::ranges::binary_search(list->times, begin);
    if (has_word && value_at(*list, begin).is_block()) return Said();
    return said_in(set.clips[clip].asset, set, path, attribute);
  };
  const auto value_of = [&](const Said& said, double time) {
    return said.property ? value_at(*said.list(), clip_time(set.times, time)) : fallback;
  };
  const std::size_t active = set.active();
  const auto is_silent = [&](const Said& said) { return !said.property && fallback.is_empty(); };
  const auto answer_by = [&](const Said& said, Value value) {
    return said.property ? Answer{std::move(value), said.layer, said.property}
                         : Answer{std::move(value), manifest, declared};
  };

  Said said = said_by(active);
  Value value = value_of(said, set.time);
  double from = last_said(set.times, said.list(), set.time, set.span(active));
  if (is_silent(said) && set.bridges_gaps) {
    std::size_t clip = active;
    while (is_silent(said) && clip > 0) said = said_by(--clip);
    if (is_silent(said)) {
      clip = active;
      while (is_silent(said) && clip + 1 < set.clips.size()) said = said_by(++clip);
      value = value_of(said, set.clips[clip].begin);
      from = INFINITY;
    } else {
      const Span span = set.span(clip);
      from = last_said(set.times, said.list(), std::nextafter(span.end, span.begin), span);
      value = value_of(said, from);
    }
  }
  if (is_silent(said)) return declared ? Answer{Value::block(), manifest, declared} : Answer();
  Answer answer = answer_by(said, std::move(value));
  for (std::size_t clip = active + 1; clip < set.clips.size(); ++clip) {
    const double begin = set.clips[clip].begin;
    if (from >= begin) break;
    const Said next = said_by(clip);
    if (is_silent(next) && set.bridges_gaps) continue;
    if (!is_silent(next)) {
      answer.value =
          blended(answer.value, value_of(next, begin), (set.time - from) / (begin - from));
      answer.is_between = true;
    }
    break;
  }
  return answer;
}

FoundValue ValueClips::find(const Prim& prim, std::string_view attribute,
                            const IndexNode** anchor) {
  for (const Prim* at = &prim; at && at->has_clips; at = at->parent) {
    for (const ClipSet& set : sets_of(*at)) {
      const std::string path = path::replace_prefix(prim.path, at->path, set.prim_path);
      Answer answer = answer_of(set, path, attribute);
      if (!answer.property) continue;
      if (anchor) {
        const std::string site = set.node_path + prim.path.substr(at->path.size());
        for (const IndexNode& node : prim.index.nodes) {
          if (*anchor || node.stack != set.stack) continue;
          if (path::strip_variants(node.path) == site) *anchor = &node;
        }
      }
      if (answer.value.is_block()) return {std::move(answer.value), nullptr, nullptr, nullptr};
      // What is blended between two clips is this set's alone.
      auto& known = timed_[{answer.property, clip_time(set.times, set.time),
                            answer.is_between ? &set : nullptr}];
      if (!known) known = std::make_unique<PropertySpec>(*answer.property);
      return {std::move(answer.value), answer.layer.get(), set.stack, known.get()};
    }
  }
  return {};
}

void add_clip_assets(const Dictionary& clips, std::set<std::string>& assets) {
  for (const auto& [name, set] : clips) {
    const Dictionary* fields = set.as_dictionary();
    if (!fields) continue;
    const Value* manifest = find(*fields, "manifestAssetPath");
    if (manifest && manifest->as_text()) assets.insert(*manifest->as_text());
    const Value* listed = find(*fields, "assetPaths");
    if (listed && listed->as_strings()) {
      assets.insert(listed->as_strings()->begin(), listed->as_strings()->end());
    }
    const std::optional<ClipTemplate> files = template_of(*fields);
    for (double number = 0.0;
         files && number < files->count() && double(assets.size()) < kMostClips; ++number) {
      assets.insert(fill_template(*files->pattern, files->first + number * files->stride));
    }
  }
}

}  // namespace diorama::usd
