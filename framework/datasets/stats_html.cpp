// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string_view>

#include "framework/datasets/dataset_stats.h"
#include "framework/datasets/decimal.h"
#include "framework/pipeline/view_report.h"

namespace diorama {
namespace {

/// The page needs nothing but itself. Pictures are drawn as SVG; their titles say the numbers.
constexpr std::string_view kHead = R"(<!DOCTYPE html>
<html lang='en'><head><meta charset='utf-8'>
<meta name='viewport' content='width=device-width'>
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 68em; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; } th, td { padding: .2em .9em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; } th { border-bottom: 2px solid #888; }
figure { display: inline-block; margin: .5em 1.5em .5em 0; vertical-align: top; } figcaption { font-size: .85em; color: #555; }
.bar { fill: #4878a8; } .cell { stroke: #eee; } .axis { font-size: 10px; fill: #555; } .bad { color: #a02020; }
</style>
)";

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string figure(const std::string& caption, int width, int height, const std::string& drawing) {
  const std::string size = std::to_string(width) + "' height='" + std::to_string(height);
  return "<figure><svg width='" + size + "' role='img'>" + drawing + "</svg><figcaption>" +
         escaped(caption) + "</figcaption></figure>\n";
}

std::string rectangle(double x, double y, double width, double height, const std::string& style,
                      const std::string& title) {
  return "<rect x='" + decimal(x, 1) + "' y='" + decimal(y, 1) + "' width='" + decimal(width, 1) +
         "' height='" + decimal(height, 1) + "' " + style + "><title>" + escaped(title) +
         "</title></rect>";
}

std::string label(double x, double y, const std::string& text) {
  return "<text class='axis' x='" + decimal(x, 1) + "' y='" + decimal(y, 1) + "'>" + escaped(text) +
         "</text>";
}

std::string bars(const std::string& caption, const Histogram& values, double unit, int digits) {
  if (values.total() == 0) return {};
  constexpr int kWidth = 300;
  constexpr int kHeight = 110;
  std::int64_t most = 1;
  for (const std::int64_t count : values.counts()) most = std::max(most, count);
  const double step = (values.high() - values.low()) / double(values.counts().size());
  const double width = double(kWidth) / double(values.counts().size());
  std::string drawing;
  for (std::size_t i = 0; i < values.counts().size(); ++i) {
    const std::int64_t count = values.counts()[i];
    if (count == 0) continue;
    const double height = std::max(1.0, (kHeight - 14) * double(count) / double(most));
    const double from = (values.low() + double(i) * step) * unit;
    drawing +=
        rectangle(double(i) * width, kHeight - 12 - height, width - 1.0, height, "class='bar'",
                  decimal(from, digits) + " to " + decimal(from + step * unit, digits) + ": " +
                      std::to_string(count));
  }
  drawing += label(0, kHeight - 1, decimal(values.low() * unit, digits)) +
             label(kWidth - 24, kHeight - 1, decimal(values.high() * unit, digits));
  return figure(caption + ", mean " + decimal(values.mean() * unit, digits + 1), kWidth, kHeight,
                drawing);
}

template <std::size_t Columns, std::size_t Rows>
std::string heat_map(const std::string& caption,
                     const std::array<std::array<std::int64_t, Columns>, Rows>& grid) {
  constexpr int kCell = 14;
  std::int64_t most = 0;
  for (const auto& row : grid) most = std::max(most, *std::ranges::max_element(row));
  if (most == 0) return {};
  std::string drawing;
  for (std::size_t y = 0; y < Rows; ++y) {
    for (std::size_t x = 0; x < Columns; ++x) {
      const double share = std::sqrt(double(grid[y][x]) / double(most));
      const auto channel = [&](double full) {
        return std::to_string(std::lround(255.0 - share * (255.0 - full)));
      };
      drawing += rectangle(
          double(x) * kCell, double(y) * kCell, kCell, kCell,
          "class='cell' fill='rgb(" + channel(24) + "," + channel(64) + "," + channel(120) + ")'",
          std::to_string(grid[y][x]));
    }
  }
  return figure(caption, int(Columns) * kCell, int(Rows) * kCell, drawing);
}

std::string row(const std::vector<std::string>& cells, const char* tag) {
  std::string text = "<tr>";
  for (const std::string& cell : cells) {
    text += std::string("<") + tag + ">" + escaped(cell) + "</" + tag + ">";
  }
  return text + "</tr>\n";
}

std::string counts(const char* title, const std::map<std::string, std::int64_t>& values) {
  if (values.empty()) return {};
  std::string text = "<table>" + row({title, "pictures"}, "th");
  for (const auto& [name, count] : values) text += row({name, std::to_string(count)}, "td");
  return text + "</table>\n";
}

std::string name_of(const std::string& name) { return name.empty() ? "(no label)" : name; }

std::string html_class_table(const DatasetStats& stats) {
  const auto mean = [](const Histogram& values, int digits) {
    return values.total() == 0 ? std::string("-") : decimal(values.mean(), digits);
  };
  std::string text =
      "<table>" +
      row({"class", "objects", "pictures", "box side", "visible", "truncated", "distance m"}, "th");
  for (const auto& [name, own] : stats.classes) {
    text += row({name_of(name), std::to_string(own.objects), std::to_string(own.pictures),
                 mean(own.box_side, 3), mean(own.visible, 3), mean(own.truncation, 3),
                 mean(own.distance_m, 2)},
                "td");
  }
  return text + "</table>\n";
}

std::string class_pictures(const std::string& name, const ClassStats& own) {
  if (own.objects == 0) return {};
  auto from_above = own.views;
  std::ranges::reverse(from_above);
  return "<h2>" + escaped(name_of(name)) + "</h2>\n" +
         heat_map("where in the picture", own.places) +
         heat_map("seen from, above to below; columns: 30 degrees each from its x axis",
                  from_above) +
         bars("side of the box, percent of the picture", own.box_side, 100.0, 0) +
         bars("visible, percent", own.visible, 100.0, 0) +
         bars("truncated, percent", own.truncation, 100.0, 0) +
         bars("distance, m", own.distance_m, 1.0, 0);
}

std::string suspicious_list(const DatasetStats& stats) {
  if (stats.suspicious.empty()) return "<p>no suspicious picture</p>\n";
  std::string text;
  for (const auto& [what, list] : stats.suspicious) {
    text += "<p class='bad'>" + escaped(what) + ": " + std::to_string(list.count) + "</p><ul>";
    for (const std::string& name : list.names) text += "<li>" + escaped(name) + "</li>";
    text += "</ul>\n";
  }
  return text;
}

}  // namespace

std::string stats_html(const DatasetStats& stats, const std::string& title) {
  std::string text(kHead);
  text += "<title>" + escaped(title) + "</title></head><body>\n<h1>" + escaped(title) +
          "</h1>\n<p>" + escaped(stats.format) + ": " + std::to_string(stats.captures) +
          " captures, " + std::to_string(stats.pictures) + " pictures</p>\n";
  text += counts("camera", stats.pictures_by_camera) + counts("split", stats.pictures_by_split) +
          counts("size", stats.pictures_by_size);
  text += "<h2>Classes</h2>\n" + html_class_table(stats);
  text += "<h2>Pictures</h2>\n" + bars("objects in a picture", stats.objects_per_picture, 1.0, 0) +
          bars("brightness, percent", stats.brightness, 100.0, 0);
  text += "<h2>Pictures to look at</h2>\n" + suspicious_list(stats);
  if (stats.findings > 0) {
    text += "<p class='bad'>" + std::to_string(stats.findings) +
            " things in the files cannot be right; <code>diorama lint</code> says which</p>\n";
  }
  if (const std::string views = views_text(stats.views); !views.empty()) {
    text += "<h2>Views</h2>\n<pre>" + escaped(views) + "</pre>\n";
  }
  for (const auto& [name, own] : stats.classes) text += class_pictures(name, own);
  return text + "</body></html>\n";
}

}  // namespace diorama
