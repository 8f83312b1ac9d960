// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <nlohmann/json.hpp>

#include "framework/datasets/dataset_stats.h"
#include "framework/datasets/decimal.h"
#include "framework/pipeline/view_report.h"

namespace diorama {
namespace {

using OrderedJson = nlohmann::ordered_json;

/// From nothing to most, of one character.
constexpr const char* kShades = " .:-=+*#%@";

std::string cell(const std::string& text, std::size_t width) {
  return text.size() < width ? std::string(width - text.size(), ' ') + text : text;
}

std::string mean_of(const Histogram& values, int digits) {
  return values.total() == 0 ? "-" : decimal(values.mean(), digits);
}

template <std::size_t Columns, std::size_t Rows>
using Grid = std::array<std::array<std::int64_t, Columns>, Rows>;

template <std::size_t Columns, std::size_t Rows>
std::int64_t sum_of(const Grid<Columns, Rows>& grid) {
  std::int64_t sum = 0;
  for (const auto& row : grid) {
    for (const std::int64_t count : row) sum += count;
  }
  return sum;
}

template <std::size_t Columns, std::size_t Rows>
std::string grid_text(const Grid<Columns, Rows>& grid) {
  std::int64_t most = 1;
  for (const auto& row : grid) {
    for (const std::int64_t count : row) most = std::max(most, count);
  }
  std::string text;
  for (const auto& row : grid) {
    text += "    |";
    for (const std::int64_t count : row) {
      // Anything but nothing is visible.
      const std::size_t shade = count == 0 ? 0 : 1 + std::size_t(8 * count / most);
      text += std::string(2, kShades[shade]);
    }
    text += "|\n";
  }
  return text;
}

std::string counts_text(const char* title, const std::map<std::string, std::int64_t>& counts) {
  if (counts.empty()) return {};
  std::string text = std::string(title) + ":";
  const char* front = " ";
  for (const auto& [name, count] : counts) {
    text += front + name + " " + std::to_string(count);
    front = ", ";
  }
  return text + "\n";
}

std::string bars(const Histogram& values, double unit, const char* name) {
  std::int64_t most = 1;
  for (const std::int64_t count : values.counts()) most = std::max(most, count);
  std::string text;
  const double width = (values.high() - values.low()) / double(values.counts().size());
  for (std::size_t i = 0; i < values.counts().size(); ++i) {
    const std::int64_t count = values.counts()[i];
    if (count == 0) continue;
    const double from = (values.low() + double(i) * width) * unit;
    text += "  " + cell(decimal(from, 0), 6) + name + cell(std::to_string(count), 9) + "  " +
            std::string(std::size_t(1 + 40 * count / most), '#') + "\n";
  }
  return text;
}

std::string text_class_table(const DatasetStats& stats) {
  std::size_t width = 5;
  for (const auto& [name, own] : stats.classes) width = std::max(width, name.size());
  std::string text = std::string("class") + std::string(width - 5, ' ') +
                     "   objects  pictures  box side  visible  truncated  distance m\n";
  for (const auto& [name, own] : stats.classes) {
    text += name + std::string(width - name.size(), ' ') + cell(std::to_string(own.objects), 10) +
            cell(std::to_string(own.pictures), 10) + cell(mean_of(own.box_side, 3), 10) +
            cell(mean_of(own.visible, 3), 9) + cell(mean_of(own.truncation, 3), 11) +
            cell(mean_of(own.distance_m, 2), 12) + "\n";
  }
  return text;
}

OrderedJson histogram_json(const Histogram& values) {
  if (values.total() == 0) return nullptr;
  return {{"low", values.low()},    {"high", values.high()},   {"counts", values.counts()},
          {"mean", values.mean()},  {"least", values.least()}, {"most", values.most()},
          {"total", values.total()}};
}

}  // namespace

std::string stats_text(const DatasetStats& stats) {
  std::string text = stats.format + ": " + std::to_string(stats.captures) + " captures, " +
                     std::to_string(stats.pictures) + " pictures\n";
  text += counts_text("cameras", stats.pictures_by_camera);
  text += counts_text("splits", stats.pictures_by_split);
  text += counts_text("sizes", stats.pictures_by_size);
  text += "\n" + text_class_table(stats);
  if (stats.objects_per_picture.total() > 0) {
    text += "\nobjects in a picture: " + decimal(stats.objects_per_picture.mean(), 2) + " (" +
            decimal(stats.objects_per_picture.least(), 0) + " to " +
            decimal(stats.objects_per_picture.most(), 0) + ")\n" +
            bars(stats.objects_per_picture, 1.0, "");
  }
  if (stats.brightness.total() > 0) {
    text += "\nbrightness of pictures, percent\n" + bars(stats.brightness, 100.0, " %");
  }
  for (const auto& [name, own] : stats.classes) {
    if (own.objects == 0) continue;
    text += "\n" + (name.empty() ? std::string("(no label)") : name) + ": where in the picture\n" +
            grid_text(own.places);
    if (sum_of(own.views) == 0) continue;
    text +=
        "  seen from, above to below; columns: 30 degrees each round the object, from its x axis\n";
    auto from_above = own.views;
    std::ranges::reverse(from_above);
    text += grid_text(from_above);
  }
  text += stats.suspicious.empty() ? "\nno suspicious picture\n" : "\nsuspicious pictures\n";
  for (const auto& [what, list] : stats.suspicious) {
    text += "  " + what + ": " + std::to_string(list.count);
    const char* front = " (";
    for (std::size_t i = 0; i < std::min<std::size_t>(list.names.size(), 5); ++i) {
      text += front + list.names[i];
      front = "; ";
    }
    text += list.count > 5 ? " ...)\n" : ")\n";
  }
  if (const std::string views = views_text(stats.views); !views.empty()) text += "\n" + views;
  if (stats.findings > 0) {
    text += "\n" + std::to_string(stats.findings) +
            " things in the files cannot be right; 'diorama lint' says which\n";
  }
  return text;
}

std::string stats_json(const DatasetStats& stats) {
  OrderedJson classes = OrderedJson::object();
  for (const auto& [name, own] : stats.classes) {
    OrderedJson entry{{"objects", own.objects},
                      {"pictures", own.pictures},
                      {"box_side", histogram_json(own.box_side)},
                      {"visible", histogram_json(own.visible)},
                      {"truncation", histogram_json(own.truncation)},
                      {"distance_m", histogram_json(own.distance_m)},
                      {"places", own.places}};
    entry["views"] = sum_of(own.views) == 0 ? OrderedJson(nullptr) : OrderedJson(own.views);
    classes[name] = std::move(entry);
  }
  OrderedJson suspicious = OrderedJson::object();
  for (const auto& [what, list] : stats.suspicious) {
    suspicious[what] = {{"count", list.count}, {"first", list.names}};
  }
  OrderedJson json{{"format", stats.format},
                   {"holds", stats.holds},
                   {"captures", stats.captures},
                   {"pictures", stats.pictures},
                   {"cameras", stats.pictures_by_camera},
                   {"splits", stats.pictures_by_split},
                   {"sizes", stats.pictures_by_size},
                   {"classes", std::move(classes)},
                   {"objects_per_picture", histogram_json(stats.objects_per_picture)},
                   {"brightness", histogram_json(stats.brightness)},
                   {"suspicious", std::move(suspicious)},
                   {"findings", stats.findings}};
  if (!stats.views.empty()) json["views"] = OrderedJson::parse(stats.views, nullptr, false);
  return json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace diorama
