// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/view_report.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "diorama/error.h"
#include "framework/config/joined.h"
#include "framework/config/json_text.h"

namespace diorama {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string dumped(const OrderedJson& json, int indent) {
  return json.dump(indent, ' ', false, OrderedJson::error_handler_t::replace);
}

ViewCounts counts_from(const OrderedJson& json) {
  ViewCounts counts;
  counts.views = whole_of_json<std::int64_t>(json.at("views"));
  counts.draws = whole_of_json<std::int64_t>(json.at("draws"));
  for (const auto& [condition, count] : json.at("refused").items()) {
    counts.refused[condition] = whole_of_json<std::int64_t>(count);
  }
  for (const auto& [quota, parts] : json.at("quotas").items()) {
    for (const auto& [part, count] : parts.items()) {
      counts.parts[quota][part] = whole_of_json<std::int64_t>(count);
    }
  }
  for (const OrderedJson& one : json.at("unmet")) {
    counts.unmet.push_back({whole_of_json<int>(one.at("capture")),
                            one.at("camera").get<std::string>(),
                            one.at("conditions").get<std::vector<std::string>>()});
  }
  return counts;
}

}  // namespace

void ViewCounts::add(int capture, const std::vector<ViewOutcome>& outcomes) {
  for (const ViewOutcome& outcome : outcomes) {
    ++views;
    draws += outcome.draws;
    for (const auto& [condition, count] : outcome.refused) refused[condition] += count;
    if (!outcome.unmet.empty()) {
      unmet.push_back({capture, outcome.camera, outcome.unmet});
      continue;
    }
    for (const auto& [quota, part] : outcome.parts) ++parts[quota][part];
  }
}

std::int64_t ViewCounts::refused_draws() const {
  std::int64_t sum = 0;
  for (const auto& [condition, count] : refused) sum += count;
  return sum;
}

std::int64_t refused_draws(const std::vector<ViewOutcome>& outcomes) {
  ViewCounts counts;
  counts.add(0, outcomes);
  return counts.refused_draws();
}

std::string outcomes_json(const std::vector<ViewOutcome>& outcomes) {
  OrderedJson list = OrderedJson::array();
  for (const ViewOutcome& outcome : outcomes) {
    list.push_back({{"camera", outcome.camera},
                    {"draws", outcome.draws},
                    {"refused", outcome.refused},
                    {"unmet", outcome.unmet},
                    {"quotas", outcome.parts}});
  }
  return dumped(list, -1);
}

std::vector<ViewOutcome> outcomes_from_json(std::string_view text) {
  try {
    std::vector<ViewOutcome> outcomes;
    for (const OrderedJson& one : parse_json<OrderedJson>(text)) {
      std::map<std::string, int> refused;
      for (const auto& [condition, count] : one.at("refused").items()) {
        refused[condition] = whole_of_json<int>(count);
      }
      outcomes.push_back({one.at("camera").get<std::string>(), whole_of_json<int>(one.at("draws")),
                          std::move(refused), one.at("unmet").get<std::vector<std::string>>(),
                          one.at("quotas").get<std::map<std::string, std::string>>()});
    }
    return outcomes;
  } catch (const std::exception& error) {
    throw Error(ErrorKind::Output,
                std::string("the journal's record of views cannot be read: ") + error.what());
  }
}

std::string views_json(const ViewCounts& counts) {
  OrderedJson json;
  json["views"] = counts.views;
  json["draws"] = counts.draws;
  json["refused"] = OrderedJson::object();
  for (const auto& [condition, count] : counts.refused) json["refused"][condition] = count;
  json["quotas"] = OrderedJson::object();
  for (const auto& [quota, parts] : counts.parts) {
    for (const auto& [part, count] : parts) json["quotas"][quota][part] = count;
  }
  json["unmet"] = OrderedJson::array();
  for (const auto& one : counts.unmet) {
    json["unmet"].push_back(
        {{"capture", one.capture}, {"camera", one.camera}, {"conditions", one.conditions}});
  }
  return dumped(json, 1) + "\n";
}

std::string views_text(std::string_view json) {
  const OrderedJson parsed = parse_json_or_nothing<OrderedJson>(json);
  if (!parsed.is_object()) return {};
  try {
    return views_text(counts_from(parsed));
  } catch (const std::exception&) {
    return {};  // somebody else's file of that name
  }
}

std::string views_text(const ViewCounts& counts) {
  if (counts.views == 0) return {};
  std::int64_t refused = 0;
  std::vector<std::pair<std::int64_t, std::string>> by_count;
  for (const auto& [condition, count] : counts.refused) {
    refused += count;
    by_count.emplace_back(-count, condition);
  }
  std::sort(by_count.begin(), by_count.end());
  std::string text = "views: " + std::to_string(counts.views) + " of " +
                     std::to_string(counts.draws) + " draws; " + std::to_string(refused) +
                     " refused";
  const char* front = ": ";
  for (const auto& [count, condition] : by_count) {
    text += front + condition + " " + std::to_string(-count);
    front = ", ";
  }
  text += "\n";
  for (const auto& [quota, parts] : counts.parts) {
    // One line each, as far as anybody reads it.
    constexpr std::size_t kMostParts = 12;
    std::int64_t least = parts.begin()->second;
    std::int64_t most = least;
    std::string list;
    for (const auto& [part, count] : parts) {
      least = std::min(least, count);
      most = std::max(most, count);
      list += (list.empty() ? "" : ", ") + part + ": " + std::to_string(count);
    }
    text += "quota " + quota + ": ";
    text += parts.size() <= kMostParts
                ? list
                : std::to_string(parts.size()) + " parts with " + std::to_string(least) + " to " +
                      std::to_string(most) + " views";
    text += "\n";
  }
  if (counts.unmet.empty()) return text;
  constexpr std::size_t kNamed = 10;
  text += std::to_string(counts.unmet.size()) + " views do not hold what 'views' asks for:\n";
  for (std::size_t i = 0; i < std::min(kNamed, counts.unmet.size()); ++i) {
    const ViewCounts::Unmet& one = counts.unmet[i];
    text += "  capture " + std::to_string(one.capture) + ", " + one.camera + ": " +
            joined(one.conditions) + "\n";
  }
  if (counts.unmet.size() > kNamed) {
    text += "  and " + std::to_string(counts.unmet.size() - kNamed) + " more, in views.json\n";
  }
  return text;
}

}  // namespace diorama
