// SPDX-License-Identifier: Apache-2.0
#include "reader_support/dataset_page.h"

#include <algorithm>
#include <stdexcept>

#include "reader_support/clip_list.h"

namespace diorama {
namespace {

constexpr const char* kPage = "dataset.json";
constexpr std::uintmax_t kMostPageBytes = std::uintmax_t(256) << 20;
constexpr int kMostCaptures = 100'000'000;

/// An empty object when there is none to be read.
Json object_in(const std::filesystem::path& file, std::uintmax_t most_bytes) {
  try {
    Json page = parse_stored_json(read_whole_file(file, most_bytes));
    return page.is_object() ? page : Json::object();
  } catch (const std::exception&) {
    return Json::object();
  }
}

Json parsed_page(const std::filesystem::path& folder) {
  return object_in(folder / kPage, kMostPageBytes);
}

}  // namespace

Json metadata_page(const std::filesystem::path& folder) {
  return object_in(folder / "metadata.txt", std::uintmax_t(1) << 20);
}

std::string metadata_writer(const std::filesystem::path& folder) {
  const Json json = metadata_page(folder);
  const auto name = json.find("name");
  return name != json.end() && name->is_string() ? name->get<std::string>() : std::string();
}

std::string zero_padded(int number, std::size_t digits) {
  const std::string text = std::to_string(number);
  return text.size() < digits ? std::string(digits - text.size(), '0') + text : text;
}

std::string DatasetPage::stem(int capture, const std::string& camera) const {
  const std::size_t digits =
      std::max<std::size_t>(6, std::to_string(std::max(captures - 1, 0)).size());
  return zero_padded(capture, digits) + "_" + camera;
}

std::optional<DatasetPage> read_dataset_page(const std::filesystem::path& folder) {
  const Json json = parsed_page(folder);
  if (!json.contains("split") || !json.contains("cameras")) return std::nullopt;
  try {
    DatasetPage page;
    page.captures = whole_number<int>(json.at("captures"));
    if (page.captures < 0 || page.captures > kMostCaptures) return std::nullopt;
    page.cameras = json.at("cameras").get<std::vector<std::string>>();
    if (json.contains("classes")) page.classes = json.at("classes").get<std::vector<std::string>>();
    const auto conventions = json.find("conventions");
    if (conventions != json.end() && conventions->is_object()) page.conventions = *conventions;
    for (const auto& [split, captures] : json.at("split").items()) {
      for (const Json& capture : captures) {
        const int index = whole_number<int>(capture);
        if (index >= 0 && index < page.captures) page.split_of_capture.emplace(index, split);
      }
    }
    const auto job = json.find("job");
    page.is_rendered =
        job != json.end() && job->is_string() && !job->get_ref<const std::string&>().empty();
    if (json.contains("clips")) page.clips = clips_of_json(json.at("clips"));
    return page;
  } catch (const std::runtime_error&) {
    return std::nullopt;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

void check_class_order(const DatasetPage& page, StoredFiles& files) {
  const auto order = page.conventions.find("class_order");
  if (order == page.conventions.end() || *order != "sorted") return;
  files.check(std::ranges::is_sorted(page.classes), kIds, kPage, "classes", "are not sorted",
              "sorted, as its convention class_order says");
}

std::span<const DatasetClip> clips_of(const std::optional<DatasetPage>& page) {
  return page ? std::span<const DatasetClip>(page->clips) : std::span<const DatasetClip>();
}

void note_clips(std::span<const DatasetClip> clips, StoredInfo& info) {
  if (!clips.empty()) info.holds.emplace(kHoldsClips);
}

Recognition recognise_page(const std::filesystem::path& folder, const std::string& format) {
  const Json json = parsed_page(folder);
  const auto said = json.find("format");
  const bool is_named = said != json.end() && said->is_string() && *said == format;
  return is_named ? Recognition::ByName : Recognition::No;
}

}  // namespace diorama
