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
  std::vector<ListedPicture> planned;
  cameras_ = page ? page->cameras : std::vector<std::string>{"camera"};
  for (ListedPicture& picture : pictures) {
    const auto number =
        page ? number_of(picture.stem) : std::optional(std::pair(int(planned.size()), 0));
    const std::string file = folders.at(picture.folder) + picture.stem + picture.ending;
    files.check(number.has_value(), kCounts, file, "",
                "is of no capture and camera that dataset.json plans");
    if (!number) continue;
    picture.capture = number->first;
    picture.camera = std::uint32_t(number->second);
    planned.push_back(std::move(picture));
  }
  rows_.set(std::move(planned), [&](const ListedPicture& picture, const ListedPicture* known) {
    files.check(!known, kOnce, folders.at(picture.folder) + picture.stem + picture.ending, "",
                "is there a second time",
                known ? "only as " + folders.at(known->folder) + known->stem : "");
  });
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
  constexpr std::array kEndings{".png", ".jpg", ".jpeg", ".bmp",  ".tga", ".exr",
                                ".hdr", ".tif", ".tiff", ".webp", ".jp2"};
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
