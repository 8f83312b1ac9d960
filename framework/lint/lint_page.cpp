// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/lint_page.h"

#include <algorithm>
#include <stdexcept>

namespace diorama::lint {
namespace {

constexpr const char* kPage = "dataset.json";
constexpr const char* kStated = "conventions and origin are stated";
constexpr const char* kSplit = "each capture is in one split";
constexpr std::size_t kMostPictures = 10'000'000;

void check_stated(Dataset& dataset, const Json& page) {
  for (const char* key : {"format", "program", "seed", "captures", "cameras", "classes", "split",
                          "conventions", "plugins", "assets", "job"}) {
    dataset.check(page.contains(key), kStated, kPage, "has no entry '" + std::string(key) + "'");
  }
  for (const char* key :
       {"units", "world_axes", "camera_axes", "pixels", "boxes", "rotations", "depth"}) {
    dataset.check(page.at("conventions").contains(key), kStated, kPage,
                  "its conventions do not say '" + std::string(key) + "'");
  }
  for (const Json& asset : page.at("assets")) {
    for (const Json& file : asset.at("files")) {
      const std::string hash = file.at("sha256").get<std::string>();
      const bool is_hash =
          hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
      dataset.check(is_hash, kStated, kPage, file.at("file").dump() + " has no SHA-256");
    }
  }
}

std::string padded(int number, std::size_t digits) {
  const std::string text = std::to_string(number);
  return text.size() < digits ? std::string(digits - text.size(), '0') + text : text;
}

void check_split(Dataset& dataset, const Json& page, DatasetPage& result) {
  const int captures = page.at("captures").get<int>();
  const auto cameras = page.at("cameras").get<std::vector<std::string>>();
  const std::size_t digits =
      std::max<std::size_t>(6, std::to_string(std::max(captures - 1, 0)).size());
  result.cameras = int(cameras.size());
  std::set<int> seen;
  for (const auto& [split, list] : page.at("split").items()) {
    for (const Json& entry : list) {
      const int capture = entry.get<int>();
      dataset.check(capture >= 0 && capture < captures && seen.insert(capture).second, kSplit,
                    kPage, "capture " + std::to_string(capture) + " is in two splits or unknown");
      if (result.pictures.size() + cameras.size() > kMostPictures) {
        throw std::runtime_error("names more pictures than any dataset has");
      }
      for (int camera = 0; camera < result.cameras; ++camera) {
        result.pictures.push_back(
            {split, capture, camera, padded(capture, digits) + "_" + cameras[std::size_t(camera)]});
      }
    }
  }
  dataset.check(int(seen.size()) == captures, kSplit, kPage,
                std::to_string(captures) + " captures, " + std::to_string(seen.size()) +
                    " of them in a split");
  std::ranges::sort(result.pictures, {}, [](const PlannedPicture& picture) {
    return std::pair(picture.capture, picture.camera);
  });
}

}  // namespace

DatasetPage lint_page(Dataset& dataset) {
  DatasetPage result;
  const auto page = dataset.json(kPage);
  if (!page) return result;
  dataset.reading(kPage, [&] {
    check_stated(dataset, *page);
    result.classes = page->at("classes").get<std::vector<std::string>>();
    result.conventions = page->at("conventions");
    check_split(dataset, *page, result);
  });
  return result;
}

}  // namespace diorama::lint
