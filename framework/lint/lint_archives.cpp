// SPDX-License-Identifier: Apache-2.0
// Formats that keep a sample's files in one container: WebDataset, HDF5.
#include <cstring>
#include <sstream>

#include "framework/lint/lint_formats.h"

namespace diorama::lint {
namespace {

std::size_t octal_number(const std::string& tar, std::size_t at, std::size_t length) {
  return std::stoull("0" + std::string(tar.substr(at, length).c_str()), nullptr, 8);
}

/// Names and contents. Throws when a header's checksum is wrong or the end is missing.
std::map<std::string, std::string> read_tar(const std::string& tar) {
  constexpr std::size_t kBlock = 512;
  std::map<std::string, std::string> members;
  std::size_t at = 0;
  while (at + kBlock <= tar.size() && tar[at] != '\0') {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < kBlock; ++i) {
      sum += i >= 148 && i < 156 ? ' ' : static_cast<unsigned char>(tar[at + i]);
    }
    if (sum != octal_number(tar, at + 148, 8)) throw std::runtime_error("a header is damaged");
    const std::string name(tar.substr(at, 100).c_str());
    const std::size_t size = octal_number(tar, at + 124, 12);
    if (at + kBlock + size > tar.size()) throw std::runtime_error(name + " is cut short");
    members.emplace(name, tar.substr(at + kBlock, size));
    at += kBlock + (size + kBlock - 1) / kBlock * kBlock;
  }
  if (at + 2 * kBlock > tar.size()) throw std::runtime_error("the end of the archive is missing");
  return members;
}

void check_sample(Dataset& dataset, const std::string& file, const std::string& key,
                  const std::map<std::string, std::string>& members) {
  const Json json = Json::parse(members.at(key + ".json"));
  const int width = json.at("width").get<int>();
  const int height = json.at("height").get<int>();
  const bool is_png = members.contains(key + ".png");
  const std::string name = key + (is_png ? ".png" : ".jpg");
  const Picture picture = parse_picture(members.at(name), name);
  dataset.check(picture.width == width && picture.height == height, "counts agree between files",
                file, name + " has another size than its json says");
  if (const auto depth = members.find(key + ".depth.npy"); depth != members.end()) {
    const NpyArray array = parse_npy(depth->second);
    dataset.check(array.shape == std::vector{std::size_t(height), std::size_t(width)},
                  "counts agree between files", file, key + ".depth.npy has another size");
  }
  const auto masks = members.find(key + ".instances.png");
  if (masks == members.end()) return;
  const auto found = extents(parse_picture(masks->second, masks->first));
  std::uint32_t place = 0;
  for (const Json& object : json.at("objects")) {
    ++place;
    const auto& b = object.at("box");
    const PixelBox box{b.at(0).get<int>(), b.at(1).get<int>(), b.at(2).get<int>(),
                       b.at(3).get<int>()};
    const auto mask = found.find(place);
    dataset.check(mask != found.end() && mask->second.box == box, "box = extent of mask", file,
                  key + ": object " + std::to_string(place) + " has the box " + box_text(box));
    if (mask == found.end()) continue;
    dataset.check(
        object.at("visible_px").get<std::int64_t>() == mask->second.count, "area = count", file,
        key + ": object " + std::to_string(place) + " has " + std::to_string(mask->second.count) +
            " pixels, its json says " + object.at("visible_px").dump());
  }
}

}  // namespace

void lint_webdataset(Dataset& dataset) {
  for (const char* list : {"train.txt", "val.txt"}) {
    const auto shards = dataset.text(list);
    if (!shards) continue;
    std::istringstream lines(*shards);
    for (std::string file; std::getline(lines, file);) {
      const auto tar = dataset.text(file);
      if (!tar) continue;
      dataset.reading(file, [&] {
        const auto members = read_tar(*tar);
        dataset.check(!members.empty(), "nothing is missing", file, "the shard is empty");
        for (const auto& [name, content] : members) {
          if (!name.ends_with(".json")) continue;
          check_sample(dataset, file, name.substr(0, name.size() - 5), members);
        }
      });
    }
  }
}

/// Checks the superblock (HDF5 File Format Specification 3.0, II.A): signature, and that the file
/// has the length it says. What lies inside is left to the HDF5 tools.
void lint_hdf5(Dataset& dataset) {
  for (const std::string& file : dataset.files()) {
    if (!file.ends_with(".hdf5")) continue;
    const auto content = dataset.text(file);
    if (!content) continue;
    const bool has_signature = content->compare(0, 8, "\x89HDF\r\n\x1a\n") == 0;
    dataset.check(has_signature && content->size() > 48, "every file can be read", file,
                  "is not an HDF5 file");
    if (!has_signature || content->size() <= 48 || (*content)[8] != 0) continue;
    std::uint64_t end = 0;
    std::memcpy(&end, content->data() + 40, sizeof end);
    dataset.check(end <= content->size(), "every file can be read", file,
                  "has " + std::to_string(content->size()) + " bytes of " + std::to_string(end));
  }
}

}  // namespace diorama::lint
