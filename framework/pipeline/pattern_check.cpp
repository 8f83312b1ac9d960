// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pattern_check.h"

#include <algorithm>
#include <set>

#include "diorama/node_pattern.h"
#include "framework/pipeline/camera_rig.h"

namespace diorama {
namespace {

using Names = std::vector<std::string_view>;

constexpr const char* kEnvironmentPath = "/Environment";

/// "/Assets/*" is "Assets" and "*".
Names names_of(std::string_view path) {
  Names names;
  if (!path.starts_with('/')) return {path};
  std::size_t start = 1;
  while (start <= path.size()) {
    const std::size_t end = std::min(path.find('/', start), path.size());
    names.push_back(path.substr(start, end - start));
    start = end + 1;
  }
  return names;
}

bool reaches_deeper(std::string_view name) { return name.find("**") != std::string_view::npos; }

/// One name, in which '*' stands for any text.
bool fits_name(std::string_view pattern, std::string_view name) {
  if (pattern.empty()) return name.empty();
  if (pattern.front() != '*') {
    return !name.empty() && pattern.front() == name.front() &&
           fits_name(pattern.substr(1), name.substr(1));
  }
  for (std::size_t skipped = 0; skipped <= name.size(); ++skipped) {
    if (fits_name(pattern.substr(1), name.substr(skipped))) return true;
  }
  return false;
}

/// How many names of the pattern fit those of the path, from the start; all of them when the
/// shorter of the two is used up or "**" leaves the rest open.
std::size_t fitting_names(const Names& pattern, const Names& path) {
  for (std::size_t i = 0; i < std::min(pattern.size(), path.size()); ++i) {
    if (reaches_deeper(pattern[i])) return pattern.size();
    if (!fits_name(pattern[i], path[i])) return i;
  }
  return pattern.size();
}

/// Every path that a visit may have outside of the environment: of all assets, falling and
/// floating.
std::vector<std::string> possible_paths(const Job& job, const CapturePlan& plan) {
  std::set<std::string> paths{kEnvironmentPath};
  // A group that is switched off may be spoken of.
  for (const ObjectGroup& group : job.objects) {
    if (group.count == 0) paths.insert(group.under);
  }
  visit_planned_objects(job, plan, [&](const PlannedObject& object) {
    const std::string& parent = job.objects[object.group].under;
    paths.insert(object.path);
    const std::string name = object.name.substr(object.name.find('_') + 1);
    for (const char* fate : {"falling_", "floating_"}) paths.insert(parent + "/" + fate + name);
  });
  for (const LightGroup& group : job.lights) {
    for (int i = 0; i < std::max(group.count, 1); ++i) {
      paths.insert("/Lights/" + group.name + "_" + std::to_string(i));
    }
  }
  for (const PlannedCamera& camera : planned_cameras(job.cameras)) {
    const std::string top = "/Cameras/" + (camera.rig.empty() ? camera.name : camera.rig);
    paths.insert(top);
    if (!camera.rig.empty()) paths.insert(top + "/" + camera.name);
  }
  return {paths.begin(), paths.end()};
}

std::vector<const Value*> texts_of(const Value& value) {
  std::vector<const Value*> texts;
  if (value.kind == Value::Kind::Scalar && !value.scalar.empty()) texts.push_back(&value);
  for (const Value& item : value.list) {
    if (item.kind == Value::Kind::Scalar) texts.push_back(&item);
  }
  return texts;
}

bool is_about_environment(std::string_view pattern) {
  const Names names = names_of(pattern);
  return names.size() > 1 && names.front() == "Environment";
}

char lower(char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; }

/// Insertions, deletions and replacements that make the first text a part of the second, upper and
/// lower case being the same. A '*' of the first costs nothing.
std::size_t distance_within(std::string_view wanted, std::string_view text) {
  std::vector<std::size_t> last(text.size() + 1, 0);
  std::vector<std::size_t> row(text.size() + 1);
  for (const char c : wanted) {
    const bool is_star = c == '*';
    row[0] = last[0] + (is_star ? 0 : 1);
    for (std::size_t j = 1; j <= text.size(); ++j) {
      row[j] = is_star ? std::min(last[j], row[j - 1])
                       : std::min({last[j] + 1, row[j - 1] + 1,
                                   last[j - 1] + (lower(c) == lower(text[j - 1]) ? 0 : 1)});
    }
    std::swap(last, row);
  }
  return *std::ranges::min_element(last);
}

/// What the pattern's first name that fits none of the paths is nearest to.
NearestText nearest_path(std::string_view pattern, const std::vector<std::string>& paths) {
  const Names names = names_of(pattern);
  std::size_t fitting = 0;
  for (const std::string& path : paths) {
    fitting = std::max(fitting, fitting_names(names, names_of(path)));
  }
  NearestText nearest;
  for (const std::string& path : paths) {
    const Names of_path = names_of(path);
    if (fitting >= of_path.size() || fitting_names(names, of_path) != fitting) continue;
    std::string shown;
    for (std::size_t i = 0; i <= fitting; ++i) shown += "/" + std::string(of_path[i]);
    nearest.add(names[fitting], of_path[fitting], shown);
  }
  return nearest;
}

/// Of the rules for environments.
std::vector<EnvironmentPattern> rule_patterns(const Job& job) {
  const EnvironmentRules& rules = job.environment;
  std::vector<EnvironmentPattern> patterns;
  const auto add = [&](const char* key, const std::vector<std::string>& texts,
                       const std::string& otherwise, LogLevel level) {
    const Value* value = rules.map.find(key);
    for (std::size_t i = 0; i < texts.size(); ++i) {
      const bool is_listed = value && i < value->list.size();
      const SourceLocation place = is_listed ? value->list[i].place
                                   : value   ? value->place
                                             : SourceLocation();
      patterns.push_back(
          {texts[i], std::string("environment.") + key, place, false, otherwise, level});
    }
  };
  // Rooms often lack some of what is hidden where it is.
  add("hide", rules.hide, "nothing is hidden for it", LogLevel::Info);
  if (job.debug) {
    add("hide_in_debug", rules.hide_in_debug, "nothing is hidden for it", LogLevel::Info);
  }
  add("box_colliders", rules.box_colliders, "nothing gets a bounding box collider for it",
      LogLevel::Warning);
  if (rules.working_area) {
    add("working_area", {*rules.working_area}, "the working area is centred on the origin",
        LogLevel::Warning);
  }
  return patterns;
}

}  // namespace

void NearestText::add(std::string_view wanted, std::string_view candidate, std::string_view shown) {
  const std::size_t distance = distance_within(wanted, candidate);
  const auto letters = std::size_t(std::ranges::count_if(wanted, [](char c) { return c != '*'; }));
  NearestText one;
  one.shown_ = shown;
  one.distance_ = distance;
  one.is_near_ = distance < letters && distance <= std::max<std::size_t>(1, letters / 3);
  add(one);
}

void NearestText::add(const NearestText& other) {
  if (!shown_.empty() && distance_ <= other.distance_) return;
  *this = other;
}

std::string NearestText::hint() const {
  if (shown_.empty()) return {};
  return is_near_ ? "; did you mean '" + shown_ + "'?" : "; the nearest is '" + shown_ + "'";
}

bool may_fit(std::string_view pattern, std::string_view path) {
  const Names names = names_of(pattern);
  return fitting_names(names, names_of(path)) == names.size();
}

std::string nearest_pattern(std::string_view pattern, const std::vector<std::string>& paths) {
  Names names = names_of(pattern);
  std::size_t fitting = 0;
  for (const std::string& path : paths) {
    fitting = std::max(fitting, fitting_names(names, names_of(path)));
  }
  if (fitting >= names.size()) return std::string(pattern);
  std::vector<std::string> known;
  for (const std::string& path : paths) {
    const Names of_path = names_of(path);
    if (of_path.size() > fitting && fitting_names(names, of_path) == fitting) {
      known.emplace_back(of_path[fitting]);
    }
  }
  const std::string near = nearest_name(names[fitting], known);
  if (near.empty()) return {};
  names[fitting] = near;
  std::string text;
  for (const std::string_view name : names) text += "/" + std::string(name);
  return text;
}

std::vector<EnvironmentPattern> check_patterns(const Job& job, const CapturePlan& plan,
                                               const DescribeComponent& describe,
                                               Diagnostics& diagnostics) {
  const std::vector<std::string> paths = possible_paths(job, plan);
  std::vector<EnvironmentPattern> open = rule_patterns(job);
  const auto fits_an_object = [&](const std::string& pattern) {
    return std::any_of(paths.begin(), paths.end(), [&](const std::string& path) {
      return path != kEnvironmentPath && may_fit(pattern, path);
    });
  };
  const auto check_value = [&](const Value& value, const std::string& key) {
    for (const Value* text : texts_of(value)) {
      const std::string& pattern = text->scalar;
      if (fits_an_object(pattern) || may_fit(pattern, kEnvironmentPath)) {
        // Objects may stand below the environment.
        if (is_about_environment(pattern) && !fits_an_object(pattern)) {
          open.push_back({pattern, key, text->place, true, "", LogLevel::Warning});
        }
        continue;
      }
      const std::string near = nearest_pattern(pattern, paths);
      diagnostics.add(text->place, key + ": '" + pattern + "' fits no node" +
                                       (near.empty() ? nearest_path(pattern, paths).hint()
                                                     : "; did you mean '" + near + "'?"));
    }
  };
  for (const RandomizerEntry& entry : job.randomizers) {
    const auto specs = describe(ComponentKind::Randomizer, entry.type);
    if (!specs) continue;
    for (const ParamSpec& spec : *specs) {
      const Value* value = spec.unit == kNodePattern ? entry.component.map.find(spec.key) : nullptr;
      if (value) check_value(*value, entry.component.path + "." + spec.key);
    }
  }
  for (const ViewRule& rule : job.views) {
    for (const char* key : {"cameras", "targets"}) {
      if (const Value* value = rule.map.find(key)) check_value(*value, rule.path + "." + key);
    }
  }
  return open;
}

std::vector<std::string> unknown_view_labels(const Job& job, const CapturePlan& plan) {
  std::set<std::string> known;
  visit_planned_objects(job, plan, [&](const PlannedObject& object) {
    for (const auto& [taxonomy, label] : object.labels) known.insert(label);
  });
  const std::vector<std::string> names(known.begin(), known.end());
  std::vector<std::string> messages;
  const auto check = [&](const std::string& label, const std::string& key) {
    if (known.contains(label)) return;
    const std::string near = nearest_name(label, names);
    messages.push_back(key + ": the job labels no object '" + label + "'" +
                       (near.empty() ? "" : "; did you mean '" + near + "'?"));
  };
  for (const ViewRule& rule : job.views) {
    for (const std::string& label : rule.labels) check(label, rule.path + ".labels");
    for (std::size_t i = 0; i < rule.quotas.size(); ++i) {
      const std::string key = rule.path + ".quotas[" + std::to_string(i) + "].labels";
      for (const std::string& label : rule.quotas[i].labels) check(label, key);
    }
  }
  return messages;
}

}  // namespace diorama
