// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/view_rules.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "diorama/node_pattern.h"
#include "framework/config/place_of.h"
#include "framework/config/value_text.h"

namespace diorama {
namespace {

constexpr const char* kSpaces[] = {"target", "world"};
constexpr const char* kAtLimit[] = {"keep_best", "stop"};
constexpr const char* kQuotaWords[] = {
    "label",         "direction", "distance_m", "azimuth_deg", "elevation_deg", "visible_pixels",
    "visible_share", "occlusion", "truncation", "size_px",     "size_share",    "occluders"};
constexpr double kMostShares = 100000.0;

/// The azimuths that a rule lets be, as an interval of at most 360 degrees.
struct Azimuths {
  explicit Azimuths(const Limits& limits)
      : from(limits.min.value_or(limits.max ? *limits.max - 360.0 : 0.0)),
        size(std::min(limits.max.value_or(from + 360.0) - from, 360.0)) {}
  double from;
  double size;
};

/// Cells of equal area have equal steps of the sine.
double sine_of(double elevation_deg) { return std::sin(elevation_deg * kPi / 180.0); }

double lowest_sine(const Limits& elevation) { return sine_of(elevation.min.value_or(-90.0)); }
double highest_sine(const Limits& elevation) { return sine_of(elevation.max.value_or(90.0)); }

std::size_t part_of(double share, int parts) {
  return std::size_t(std::clamp(share * parts, 0.0, double(parts) - 1.0));
}

/// All limits of targets, by key; for checks.
std::vector<std::pair<const char*, const Limits*>> limits_of(const ViewRule& rule) {
  return {{"count", &rule.count},
          {"visible_pixels", &rule.visible_pixels},
          {"visible_share", &rule.visible_share},
          {"occlusion", &rule.occlusion},
          {"truncation", &rule.truncation},
          {"size_px", &rule.size_px},
          {"size_share", &rule.size_share},
          {"distance_m", &rule.distance_m},
          {"azimuth_deg", &rule.azimuth_deg},
          {"elevation_deg", &rule.elevation_deg},
          {"occluders", &rule.occluders},
          {"brightness", &rule.brightness}};
}

void check_quota(const Quota& quota, const SourceLocation& place, const std::string& path,
                 Diagnostics& diagnostics) {
  const auto complain = [&](const std::string& what) { diagnostics.add(place, path + what); };
  if (quota.of == "label") {
    const std::set<std::string> different(quota.labels.begin(), quota.labels.end());
    if (quota.labels.size() < 2 || different.size() < quota.labels.size()) {
      return complain(".labels: expected two or more different labels to share the views among");
    }
  } else if (quota.of != "direction") {
    const bool rises = std::adjacent_find(quota.edges.begin(), quota.edges.end(),
                                          std::greater_equal<>()) == quota.edges.end();
    if (quota.edges.size() < 3 || !rises) {
      return complain(
          ".edges: expected three or more rising numbers, such as [0.5, 1, 2], which "
          "bound the parts that share the views");
    }
  } else if (quota.columns * quota.rows < 2) {
    return complain(".columns: expected two or more cells, columns times rows");
  }
  if (quota.shares.empty()) return;
  if (quota.shares.size() != quota.bin_count()) {
    return complain(".shares: expected " + std::to_string(quota.bin_count()) +
                    " numbers, one per part, found " + std::to_string(quota.shares.size()));
  }
  double sum = 0.0;
  for (const double share : quota.shares) {
    if (share != std::floor(share)) return complain(".shares: expected whole numbers: [1, 3]");
    sum += share;
  }
  if (sum < 1.0) return complain(".shares: all are 0");
  if (sum > kMostShares) complain(".shares: expected a sum of at most 100000");
}

}  // namespace

void Limits::visit(ParamVisitor& v) {
  v.param("min", min, {"At least; null: no bound.", unit, least, most});
  v.param("max", max, {"At most; null: no bound.", unit, least, most});
}

double Limits::shortfall(double value) const {
  const auto missed = [&](double bound) {
    return std::min(1.0, std::abs(value - bound) / std::max(std::abs(bound), 1e-3));
  };
  if (min && value < *min) return missed(*min);
  if (max && value > *max) return missed(*max);
  return 0.0;
}

void Quota::visit(ParamVisitor& v) {
  v.choice("of", of, kQuotaWords,
           {"What of a view's main target is shared out. The main target is the one with the most "
            "visible pixels among those that meet the conditions. direction: cells of equal area "
            "on the sphere round the target, within azimuth_deg and elevation_deg."});
  v.param("labels", labels, {"With label: one part of the views for each."});
  v.param(
      "edges", edges,
      {"With a number: rising bounds of the parts; [0.5, 1, 2] are two parts, and views outside "
       "of all of them are refused."});
  v.param("columns", columns, {"With direction: cells round the sphere.", "", 1, 360});
  v.param("rows", rows, {"With direction: cells from below to above.", "", 1, 180});
  v.param("shares", shares,
          {"Whole numbers, one per part: [1, 3] puts three times as many views into the second. "
           "Empty: all parts get the same.",
           "", 0, 1e4});
}

std::size_t Quota::bin_count() const {
  if (of == "label") return labels.size();
  if (of == "direction") return std::size_t(columns) * std::size_t(rows);
  return edges.empty() ? 0 : edges.size() - 1;
}

std::string Quota::bin_name(std::size_t bin) const {
  if (of == "label") return labels[bin];
  if (of != "direction") return short_number(edges[bin]) + " to " + short_number(edges[bin + 1]);
  return "column " + std::to_string(bin % std::size_t(columns)) + ", row " +
         std::to_string(bin / std::size_t(columns));
}

std::optional<std::size_t> Quota::bin_of(double value) const {
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const bool is_last = i + 2 == edges.size();
    const bool is_below = is_last ? value <= edges[i + 1] : value < edges[i + 1];
    if (value >= edges[i] && is_below) return i;
  }
  return std::nullopt;
}

std::optional<std::size_t> Quota::bin_of_label(const std::string& label) const {
  const auto found = std::find(labels.begin(), labels.end(), label);
  if (found == labels.end()) return std::nullopt;
  return std::size_t(found - labels.begin());
}

void ViewRule::visit(ParamVisitor& v) {
  v.param("name", name,
          {"For messages and the quotas' random numbers. Default: views_0 and so on."});
  v.param("on", on, {"Capture series whose views it is about; empty: all."});
  v.param("cameras", cameras, {"Cameras whose views it is about.", kNodePattern});
  v.param("targets", targets, {"Labelled nodes that count as targets.", kNodePattern});
  v.param("taxonomy", taxonomy, {"Taxonomy of the labels."});
  v.param("labels", labels, {"Only targets with one of these labels count; empty: all."});
  v.group("count", count, {"How many targets have to meet all conditions below."});
  v.param("every_target", every_target,
          {"Every target with a visible pixel has to meet them, not just `count` of them."});
  v.group("visible_pixels", visible_pixels,
          {"Pixels of the target that are seen; at least one in any case."});
  v.group(
      "visible_share", visible_share,
      {"Seen pixels by those that it would cover without occluders and in an endless picture."});
  v.group("occlusion", occlusion, {"Share of its pixels in the picture that something covers."});
  v.group("truncation", truncation, {"Share of its pixels that lie outside of the picture."});
  v.group("size_px", size_px, {"Longer side of the box round its seen pixels."});
  v.group("size_share", size_share,
          {"The same as a share of the picture's width or height, the larger of the two."});
  v.group("distance_m", distance_m, {"From the camera to the middle of the target's box."});
  v.group("azimuth_deg", azimuth_deg,
          {"Where the camera stands round the target's z axis, from its x axis towards y."});
  v.group("elevation_deg", elevation_deg,
          {"Where the camera stands above (90) or below (-90) the target."});
  v.choice("direction_space", direction_space, kSpaces,
           {"Axes of azimuth and elevation: the target's own, or the world's."});
  v.group("occluders", occluders, {"How many things are seen in front of it."});
  v.group("brightness", brightness,
          {"Mean of the picture's sRGB values, 0 to 1. Judged last, on a picture of a quarter of "
           "width and height, and once more on the picture itself."});
  v.list("quotas", quotas,
         {"Parts of all views of the dataset. Which part a view has to fall into follows from its "
          "number and the seed."});
  v.param("together", together,
          {"Cameras are drawn anew all together, until all of them hold; else each by itself. "
           "Cameras of one rig always are."});
  v.param("max_tries", max_tries, {"Draws per view at most, the first one included.", "", 1, 1e6});
  v.choice("at_limit", at_limit, kAtLimit,
           {"When no draw held. keep_best: the one that came nearest stays, and is named in the "
            "log and in views.json; stop: the job ends with an error."});
}

bool ViewRule::is_on(const std::string& series) const {
  return on.empty() || std::find(on.begin(), on.end(), series) != on.end();
}

double turned_into(const Limits& limits, double azimuth_deg) {
  const Azimuths range(limits);
  double turned = std::fmod(azimuth_deg - range.from, 360.0);
  if (turned < 0.0) turned += 360.0;
  return range.from + turned;
}

std::optional<std::size_t> ViewRule::direction_bin(const Quota& quota, double azimuth,
                                                   double elevation) const {
  const Azimuths range(azimuth_deg);
  const double turned = turned_into(azimuth_deg, azimuth);
  if (!azimuth_deg.hold(turned) || !elevation_deg.hold(elevation)) return std::nullopt;
  const double low = lowest_sine(elevation_deg);
  const double high = highest_sine(elevation_deg);
  if (!(range.size > 0.0 && high > low)) return std::nullopt;
  const std::size_t column = part_of((turned - range.from) / range.size, quota.columns);
  const std::size_t row = part_of((sine_of(elevation) - low) / (high - low), quota.rows);
  return row * std::size_t(quota.columns) + column;
}

void check_view_rule(const ViewRule& rule, const std::vector<std::string>& series,
                     Diagnostics& diagnostics) {
  for (const std::string& name : rule.on) {
    if (std::find(series.begin(), series.end(), name) != series.end()) continue;
    const std::string near = nearest_name(name, series);
    std::string known;
    for (const std::string& one : series) known += (known.empty() ? "" : ", ") + one;
    diagnostics.add(place_of(rule.map, "on"),
                    rule.path + ".on: unknown capture series '" + name + "'" +
                        (near.empty() ? "" : "; did you mean '" + near + "'?") +
                        " (known: " + known + ")");
  }
  for (const auto& [key, limits] : limits_of(rule)) {
    if (!limits->min || !limits->max || *limits->min <= *limits->max) continue;
    diagnostics.add(place_of(rule.map, key),
                    rule.path + "." + key + ": min (" + short_number(*limits->min) +
                        ") is greater than max (" + short_number(*limits->max) + ")");
  }
  const Value* list = rule.map.find("quotas");
  for (std::size_t i = 0; i < rule.quotas.size(); ++i) {
    const bool is_there = list && i < list->list.size();
    check_quota(rule.quotas[i], is_there ? list->list[i].place : rule.map.place,
                rule.path + ".quotas[" + std::to_string(i) + "]", diagnostics);
  }
}

std::size_t quota_bin(const Quota& quota, const Rng& rng, std::uint64_t view) {
  std::vector<std::size_t> order;
  for (std::size_t bin = 0; bin < quota.bin_count(); ++bin) {
    const auto share = quota.shares.empty() ? std::size_t(1) : std::size_t(quota.shares[bin]);
    order.insert(order.end(), share, bin);
  }
  Rng round = rng.fork(view / order.size());
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[round.index(i)]);
  return order[view % order.size()];
}

}  // namespace diorama
