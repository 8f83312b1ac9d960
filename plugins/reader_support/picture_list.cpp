// SPDX-License-Identifier: Apache-2.0
#include "reader_support/picture_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

namespace diorama {

void PictureList::set(std::vector<ListedPicture> pictures, const std::optional<DatasetPage>& page,
                      const NumberOf& number_of, const std::vector<std::string>& folders,
                      StoredFiles& files) {
  pictures_.clear();
  cameras_ = page ? page->cameras : std::vector<std::string>{"camera"};
  for (ListedPicture& picture : pictures) {
    const auto number =
        page ? number_of(picture.stem) : std::optional(std::pair(int(pictures_.size()), 0));
    const std::string file = folders.at(picture.folder) + picture.stem + picture.ending;
    files.check(number.has_value(), kCounts, file, "",
                "is of no capture and camera that dataset.json plans");
    if (!number) continue;
    picture.capture = number->first;
    picture.camera = std::uint32_t(number->second);
    pictures_.push_back(std::move(picture));
  }
  std::ranges::stable_sort(pictures_, {}, [](const ListedPicture& picture) {
    return std::pair(picture.capture, picture.camera);
  });
  std::vector<ListedPicture> once;
  first_.clear();
  for (ListedPicture& picture : pictures_) {
    const bool is_again = !once.empty() && once.back().capture == picture.capture &&
                          once.back().camera == picture.camera;
    files.check(!is_again, kOnce, folders.at(picture.folder) + picture.stem + picture.ending, "",
                "is there a second time",
                is_again ? "only as " + folders.at(once.back().folder) + once.back().stem : "");
    if (is_again) continue;
    if (once.empty() || once.back().capture != picture.capture) first_.push_back(once.size());
    once.push_back(std::move(picture));
  }
  pictures_ = std::move(once);
  first_.push_back(pictures_.size());
}

std::vector<int> PictureList::captures() const {
  std::vector<int> captures;
  for (std::size_t i = 0; i + 1 < first_.size(); ++i)
    captures.push_back(pictures_[first_[i]].capture);
  return captures;
}

std::span<const ListedPicture> PictureList::pictures(std::size_t capture) const {
  return std::span(pictures_).subspan(first_.at(capture),
                                      first_.at(capture + 1) - first_.at(capture));
}

std::optional<std::pair<int, int>> capture_and_camera(const DatasetPage& page,
                                                      const std::string& stem) {
  int capture = 0;
  const char* end = stem.data() + stem.size();
  const auto parsed = std::from_chars(stem.data(), end, capture);
  if (parsed.ec != std::errc() || parsed.ptr == end || *parsed.ptr != '_') return std::nullopt;
  const std::string name(parsed.ptr + 1, end);
  const auto camera = std::ranges::find(page.cameras, name);
  if (camera == page.cameras.end() || capture < 0 || capture >= page.captures) return std::nullopt;
  if (page.stem(capture, name) != stem) return std::nullopt;
  return std::pair(capture, int(camera - page.cameras.begin()));
}

bool is_picture_ending(std::string ending) {
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return char(std::tolower(c)); });
  constexpr std::array kEndings{".png", ".jpg", ".jpeg", ".bmp", ".tga", ".exr", ".hdr"};
  return std::ranges::find(kEndings, ending) != kEndings.end();
}

std::vector<ListedPicture> pictures_in(const std::filesystem::path& folder, std::uint32_t place) {
  std::vector<ListedPicture> pictures;
  for (const std::string& name : names_in(folder)) {
    const std::filesystem::path path(name);
    if (!is_picture_ending(path.extension().string())) continue;
    pictures.push_back({path.stem().string(), path.extension().string(), place, 0, 0});
  }
  return pictures;
}

}  // namespace diorama
