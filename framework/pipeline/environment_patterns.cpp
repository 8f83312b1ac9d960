// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/environment_patterns.h"

#include <algorithm>
#include <map>
#include <utility>

#include "diorama/config.h"
#include "framework/pipeline/scene_setup.h"

namespace diorama {
namespace {

bool fits(const EnvironmentPattern& pattern, const Scene& scene, NodeId environment) {
  if (pattern.is_path) return !scene.match(pattern.text).empty();
  const std::size_t prefix = scene.path(environment).size();
  for (const NodeId node : scene.subtree(environment)) {
    if (node == environment) continue;
    if (holds_text(std::string_view(scene.path(node)).substr(prefix), pattern.text)) return true;
  }
  return false;
}

/// The nodes one of which the pattern's first name that fits nothing should have fitted.
std::vector<NodeId> candidates(const std::string& pattern, const Scene& scene, std::string& name) {
  for (std::size_t end = pattern.rfind('/'); end != std::string::npos && end > 0;
       end = pattern.rfind('/', end - 1)) {
    const std::vector<NodeId> above = scene.match(pattern.substr(0, end));
    if (above.empty()) continue;
    name = pattern.substr(end + 1, pattern.find('/', end + 1) - end - 1);
    std::vector<NodeId> nodes;
    for (const NodeId node : above) {
      nodes.insert(nodes.end(), scene[node].children.begin(), scene[node].children.end());
    }
    return nodes;
  }
  return {};
}

NearestText nearest_in(const EnvironmentPattern& pattern, const Scene& scene, NodeId environment) {
  std::string name = pattern.text;
  std::vector<NodeId> nodes;
  if (pattern.is_path) {
    nodes = candidates(pattern.text, scene, name);
  } else {
    nodes = scene.subtree(environment);
    nodes.erase(nodes.begin());
  }
  NearestText nearest;
  for (const NodeId node : nodes) {
    const std::string path = scene.path(node);
    // What a text with '/' may hold is more than a name.
    const bool has_parents = name.find('/') != std::string::npos;
    nearest.add(name, has_parents ? std::string_view(path) : scene[node].name, path);
  }
  return nearest;
}

std::string fitless(const EnvironmentPattern& pattern) {
  return pattern.is_path ? "no node fits '" + pattern.text + "'"
                         : "no node's path holds '" + pattern.text + "'";
}

}  // namespace

EnvironmentPatterns::EnvironmentPatterns(std::vector<EnvironmentPattern> patterns, bool are_errors)
    : patterns_(std::move(patterns)), are_errors_(are_errors) {}

void EnvironmentPatterns::try_in(const Scene& scene, NodeId environment, const std::string& asset,
                                 Host& host, const std::function<void(const Look&)>& show_others) {
  const std::lock_guard lock(mutex_);
  std::set<std::size_t> missing;
  for (std::size_t i = 0; i < patterns_.size(); ++i) {
    if (fits(patterns_[i], scene, environment)) {
      met_.insert(i);
      continue;
    }
    if (told_.emplace(i, asset).second) {
      const EnvironmentPattern& pattern = patterns_[i];
      host.log(pattern.level, asset + ": " + fitless(pattern) + " (" + pattern.key + ")" +
                                  (pattern.otherwise.empty() ? "" : "; " + pattern.otherwise));
    }
    if (!met_.contains(i)) missing.insert(i);
  }
  if (missing.empty() || !are_errors_) return;
  std::map<std::size_t, NearestText> nearest;
  const auto look = [&](const Scene& there, NodeId node) {
    std::erase_if(missing, [&](std::size_t i) {
      const bool is_met = fits(patterns_[i], there, node);
      if (is_met) met_.insert(i);
      if (!is_met) nearest[i].add(nearest_in(patterns_[i], there, node));
      return is_met;
    });
    return !missing.empty();
  };
  look(scene, environment);
  show_others(look);
  Diagnostics diagnostics;
  for (const std::size_t i : missing) {
    const EnvironmentPattern& pattern = patterns_[i];
    const std::string text = pattern.key + ": " + fitless(pattern) +
                             " in any environment of the job" + nearest[i].hint();
    // Lists of what is hidden name the lamps of many rooms: one of them has to be there.
    const bool has_other =
        pattern.level == LogLevel::Info && std::ranges::any_of(met_, [&](std::size_t other) {
          return patterns_[other].key == pattern.key;
        });
    if (!has_other) {
      diagnostics.add(pattern.place, text);
      continue;
    }
    host.log(LogLevel::Warning, text);
    met_.insert(i);  // It need not be looked for again.
  }
  diagnostics.raise();
}

}  // namespace diorama
