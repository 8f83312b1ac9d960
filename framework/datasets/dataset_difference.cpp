// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_difference.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "diorama/error.h"
#include "framework/config/json_text.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/dataset_origin.h"
#include "framework/datasets/frame_checks.h"
#include "framework/datasets/frame_difference.h"

namespace diorama {
namespace {

using Json = nlohmann::json;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Lines of a text that the other one has not, as often.
std::vector<std::string> lines_beyond(const std::string& text, const std::string& other) {
  std::multiset<std::string> known;
  for (const std::string& line : lines_of(other)) known.insert(line);
  std::vector<std::string> beyond;
  for (const std::string& line : lines_of(text)) {
    if (const auto found = known.find(line); found != known.end()) {
      known.erase(found);
    } else {
      beyond.push_back(line);
    }
  }
  return beyond;
}

std::string text_of(const Json& page, const char* key) {
  const auto found = page.find(key);
  if (found == page.end()) return "nothing";
  return found->is_string() ? found->get<std::string>()
                            : found->dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::map<std::string, std::string> assets_of(const Json& page) {
  std::map<std::string, std::string> assets;
  const auto list = page.find("assets");
  if (list == page.end() || !list->is_array()) return assets;
  for (const Json& entry : *list) {
    if (entry.is_object()) assets[text_of(entry, "asset")] = text_of(entry, "files");
  }
  return assets;
}

void compare_assets(const Json& a, const Json& b, std::vector<std::string>& lines) {
  const auto one = assets_of(a);
  const auto other = assets_of(b);
  for (const auto& [name, files] : one) {
    const auto found = other.find(name);
    if (found == other.end()) {
      lines.push_back("asset " + name + ": only in the first");
    } else if (found->second != files) {
      lines.push_back("asset " + name + ": other files");
    }
  }
  for (const auto& [name, files] : other) {
    if (!one.contains(name)) lines.push_back("asset " + name + ": only in the second");
  }
}

template <class List>
std::string list_text(const List& list) {
  std::string text;
  for (const std::string& name : list) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

/// What both hold, as exactly as the coarser one says.
StoredInfo common_info(const StoredInfo& a, const StoredInfo& b, double tolerance) {
  StoredInfo common = a;
  common.holds.clear();
  std::ranges::set_intersection(a.holds, b.holds, std::inserter(common.holds, common.holds.end()));
  for (const std::string& name : common.holds) {
    const double step = step_of(a, name) + step_of(b, name);
    if (step > 0.0) common.steps[name] = step;
  }
  if (tolerance > 0.0) {
    double& step = common.steps[std::string(kColor.name)];
    step = std::max(step, tolerance);
  }
  return common;
}

std::vector<std::string> capture_differences(const StoredInfo& common, const Capture& a,
                                             const Capture& b) {
  std::vector<std::string> lines;
  for (const Frame& frame : a.frames) {
    const auto partner = std::ranges::find_if(b.frames, [&](const Frame& other) {
      return other.camera_name == frame.camera_name ||
             (a.frames.size() == 1 && b.frames.size() == 1);
    });
    if (partner == b.frames.end()) {
      lines.push_back(frame.camera_name + ": only in the first");
      continue;
    }
    for (std::string& line : frame_differences(common, frame, *partner)) {
      lines.push_back(std::move(line));
    }
    // The comparison above takes each object that was read; those that are gone are left.
    if (frame.instances.size() > partner->instances.size()) {
      lines.push_back(frame.camera_name + ": " + std::to_string(frame.instances.size()) +
                      " objects in the first, " + std::to_string(partner->instances.size()) +
                      " in the second");
    }
  }
  return lines;
}

/// Of the capture with that number, if there is one.
std::optional<StoredCapture> read_numbered(const StoredDataset& data, int number,
                                           const NameSet& wanted) {
  const std::vector<int>& all = data.info().captures;
  const auto place = std::ranges::lower_bound(all, number);
  if (place == all.end() || *place != number) return std::nullopt;
  return data.read(std::size_t(place - all.begin()), wanted);
}

/// Why a capture cannot be compared; nothing when it can.
std::optional<std::string> loss_of(const StoredCapture& stored) {
  if (!stored.capture.frames.empty() || stored.log.findings.empty()) return std::nullopt;
  const Finding& first = stored.log.findings.front();
  return first.found.empty() ? first.check : first.found;
}

std::vector<std::string> partner_differences(const StoredInfo& common, const StoredCapture& a,
                                             const StoredDataset& b) {
  const std::optional<StoredCapture> partner = read_numbered(b, a.capture.index, common.holds);
  if (!partner) return {"only in the first"};
  std::vector<std::string> lines;
  if (const auto loss = loss_of(a)) {
    lines.push_back("cannot be read in the first: " + *loss);
  }
  if (const auto loss = loss_of(*partner)) {
    lines.push_back("cannot be read in the second: " + *loss);
  }
  return lines.empty() ? capture_differences(common, a.capture, partner->capture) : lines;
}

void compare_infos(const StoredInfo& a, const StoredInfo& b, std::vector<std::string>& lines) {
  const auto compare = [&](const char* what, const std::string& one, const std::string& other) {
    if (one != other) lines.push_back(std::string(what) + ": " + one + " | " + other);
  };
  compare("format", a.format, b.format);
  compare("cameras", list_text(a.camera_names), list_text(b.camera_names));
  if (!a.classes.empty() && !b.classes.empty()) {
    compare("classes", list_text(a.classes), list_text(b.classes));
  }
  compare("captures", std::to_string(a.captures.size()), std::to_string(b.captures.size()));
}

}  // namespace

std::vector<std::string> page_differences(const std::string& a, const std::string& b) {
  const Json one = parse_json_or_nothing(a);
  const Json other = parse_json_or_nothing(b);
  std::vector<std::string> lines;
  if (!one.is_object() || !other.is_object()) {
    if (one.is_object() != other.is_object()) {
      lines.emplace_back(std::string("dataset.json: only in the ") +
                         (one.is_object() ? "first" : "second"));
    }
    return lines;
  }
  for (const char* key :
       {"diorama", "program", "seed", "captures", "cameras", "plugins", "labels", "classes"}) {
    const std::string first = text_of(one, key);
    const std::string second = text_of(other, key);
    if (first != second) lines.push_back(std::string(key) + ": " + first + " | " + second);
  }
  compare_assets(one, other, lines);
  const std::string job = text_of(one, "job");
  const std::string other_job = text_of(other, "job");
  for (const std::string& line : lines_beyond(job, other_job)) lines.push_back("job: < " + line);
  for (const std::string& line : lines_beyond(other_job, job)) lines.push_back("job: > " + line);
  return lines;
}

void require_same_assets(const std::filesystem::path& folder, const std::string& page,
                         const std::optional<std::filesystem::path>& assets_root) {
  const auto then = assets_of(parse_json_or_nothing(page_of_run(folder)));
  const auto now = assets_of(parse_json_or_nothing(page));
  std::string first;
  std::size_t count = 0;
  const auto note = [&](const std::string& asset, const char* what) {
    if (++count == 1) first = asset + what;
  };
  for (const auto& [asset, files] : then) {
    const auto found = now.find(asset);
    if (found == now.end()) {
      note(asset, " is not among those that the job takes now");
    } else if (found->second != files) {
      note(asset, " has other files now");
    }
  }
  for (const auto& [asset, files] : now) {
    if (!then.contains(asset)) note(asset, " was not among them");
  }
  if (count == 0) return;
  throw Error(ErrorKind::Asset,
              folder.string() + ": was made of other assets: " + first +
                  (count > 1 ? ", and " + std::to_string(count - 1) + " more" : "") +
                  "; --assets-root names the folder of assets that it was made with, now it is " +
                  (assets_root ? assets_root->string() : "none"));
}

std::vector<std::string> capture_difference(const StoredDataset& a, const StoredDataset& b,
                                            int capture, double tolerance) {
  const StoredInfo common = common_info(a.info(), b.info(), tolerance);
  const std::optional<StoredCapture> first = read_numbered(a, capture, common.holds);
  if (first) return partner_differences(common, *first, b);
  const bool is_there = read_numbered(b, capture, {}).has_value();
  return {is_there ? "only in the second" : "in neither"};
}

DatasetDifference dataset_difference(const ComparedDataset& a, const ComparedDataset& b,
                                     double tolerance, Host& host) {
  DatasetDifference result;
  result.pages = page_differences(page_of_run(a.folder), page_of_run(b.folder));
  const StoredInfo& one = a.data.info();
  const StoredInfo& other = b.data.info();
  compare_infos(one, other, result.contents);
  const StoredInfo common = common_info(one, other, tolerance);
  for (const int capture : other.captures) {
    if (std::ranges::binary_search(one.captures, capture)) continue;
    result.contents.push_back("capture " + std::to_string(capture) + ": only in the second");
    if (result.contents.size() >= DatasetDifference::kMostLines) break;
  }
  struct Lines {
    int capture = 0;
    std::vector<std::string> lines;
  };
  sweep_captures<Lines>(
      a.data, common.holds, host,
      [&](const StoredCapture& stored) {
        return Lines{stored.capture.index, partner_differences(common, stored, b.data)};
      },
      [&](const Lines& lines) {
        ++result.captures;
        if (lines.lines.empty()) return;
        result.differing.push_back(lines.capture);
        for (const std::string& line : lines.lines) {
          if (result.contents.size() >= DatasetDifference::kMostLines) return;
          result.contents.push_back("capture " + std::to_string(lines.capture) + ": " + line);
        }
      });
  return result;
}

}  // namespace diorama
