// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/page_checks.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "framework/config/json_text.h"
#include "framework/datasets/check_names.h"
#include "framework/output/file_system.h"

namespace diorama {
namespace {

using Json = nlohmann::json;

constexpr const char* kPage = "dataset.json";
constexpr const char* kStated = "conventions and origin are stated";
constexpr const char* kSplit = "each capture is in one split";
constexpr int kMostCaptures = 100'000'000;

Finding about_page(const char* rule, const std::string& found, const std::string& expected = {}) {
  return {rule, kPage, std::nullopt, "", "", found, expected};
}

void check_stated(const Json& page, ReadLog& log) {
  for (const char* key : {"format", "program", "seed", "captures", "cameras", "classes", "split",
                          "conventions", "plugins", "assets", "job"}) {
    log.check(page.contains(key), about_page(kStated, "has no entry '" + std::string(key) + "'"));
  }
  for (const char* key :
       {"units", "world_axes", "camera_axes", "pixels", "boxes", "rotations", "depth"}) {
    log.check(page.at("conventions").contains(key),
              about_page(kStated, "its conventions do not say '" + std::string(key) + "'"));
  }
  for (const Json& asset : page.at("assets")) {
    for (const Json& file : asset.at("files")) {
      const std::string hash = file.at("sha256").get<std::string>();
      const bool is_hash =
          hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
      log.check(is_hash, about_page(kStated, file.at("file").dump() + " has no SHA-256"));
    }
  }
}

PlannedDataset planned_by(const Json& page, ReadLog& log) {
  PlannedDataset planned;
  planned.captures = whole_of_json<int>(page.at("captures"));
  if (planned.captures < 0 || planned.captures > kMostCaptures) {
    throw std::runtime_error("its number of captures is beyond reason");
  }
  planned.cameras = page.at("cameras").get<std::vector<std::string>>();
  for (const auto& [split, list] : page.at("split").items()) {
    for (const Json& entry : list) {
      const int capture = whole_of_json<int>(entry);
      const bool is_known = capture >= 0 && capture < planned.captures;
      log.check(is_known && planned.split_of_capture.emplace(capture, split).second,
                about_page(kSplit,
                           "capture " + std::to_string(capture) + " is in two splits or unknown"));
    }
  }
  log.check(int(planned.split_of_capture.size()) == planned.captures,
            about_page(kSplit,
                       std::to_string(planned.split_of_capture.size()) + " captures are in a split",
                       "all " + std::to_string(planned.captures)));
  return planned;
}

void compare(const Json& page, const PlannedDataset& planned, const StoredInfo& info,
             ReadLog& log) {
  std::size_t missing = 0;
  for (int capture = 0; capture < planned.captures; ++capture) {
    if (!std::ranges::binary_search(info.captures, capture)) ++missing;
  }
  log.check(missing == 0, {kNothingIsMissing, ".", std::nullopt, "", "",
                           std::to_string(missing) + " captures are not there",
                           "the " + std::to_string(planned.captures) + " of dataset.json"});
  const bool is_beyond = !info.captures.empty() && info.captures.back() >= planned.captures;
  log.check(!is_beyond,
            {kCountsAgree, ".", std::nullopt, "", "",
             "there is a capture " + (is_beyond ? std::to_string(info.captures.back()) : ""),
             "dataset.json plans " + std::to_string(planned.captures)});
  const auto classes = page.at("classes").get<std::vector<std::string>>();
  log.check(info.classes.empty() || info.classes == classes,
            {"ids within the label map", kPage, std::nullopt, "", "",
             "its classes are not those of the labels", ""});
}

}  // namespace

std::optional<PlannedDataset> check_page(const std::filesystem::path& folder,
                                         const StoredInfo& info, ReadLog& log) {
  LocalFileSystem file_system;
  if (!file_system.exists(folder / kPage)) return std::nullopt;
  ++log.files;
  try {
    const Json page = parse_json(file_system.read(folder / kPage));
    // The page of a run, or of somebody else.
    if (!page.contains("split") && !page.contains("program")) return std::nullopt;
    check_stated(page, log);
    PlannedDataset planned = planned_by(page, log);
    compare(page, planned, info, log);
    return planned;
  } catch (const std::exception& error) {
    log.findings.push_back(about_page(kFilesCanBeRead, error.what()));
    return std::nullopt;
  }
}

void check_planned(const PlannedDataset& planned, const StoredCapture& stored, ReadLog& log) {
  const int capture = stored.capture.index;
  for (const std::string& camera : planned.cameras) {
    const bool is_there = std::ranges::any_of(
        stored.capture.frames, [&](const Frame& frame) { return frame.camera_name == camera; });
    log.check(is_there,
              {kNothingIsMissing, ".", capture, camera, "", "the picture is missing", ""});
  }
  const auto split = planned.split_of_capture.find(capture);
  if (stored.split.empty() || split == planned.split_of_capture.end()) return;
  log.check(split->second == stored.split,
            {kSplit, ".", capture, "", "", "lies in '" + stored.split + "'",
             "dataset.json puts it into '" + split->second + "'"});
}

}  // namespace diorama
