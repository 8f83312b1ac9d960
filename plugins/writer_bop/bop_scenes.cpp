// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_scenes.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include "reader_support/picture_list.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

bool is_number(const std::string& name) {
  return !name.empty() && name.size() <= 9 &&
         name.find_first_not_of("0123456789") == std::string::npos;
}

/// What stands between a table's name and ".json".
std::optional<std::string> suffix_of(const std::string& file, const std::string& table) {
  if (!file.starts_with(table) || !file.ends_with(".json")) return std::nullopt;
  if (file.size() < table.size() + 5) return std::nullopt;
  std::string suffix = file.substr(table.size(), file.size() - table.size() - 5);
  if (!suffix.empty() && suffix[0] != '_') return std::nullopt;
  return suffix;
}

void add_scenes(const fs::path& root, const std::string& folder, const std::string& split,
                int number, std::vector<BopScene>& scenes) {
  const auto names = names_in(root / folder);
  const auto folders = names_in(root / folder, true);
  const auto has = [](const std::vector<std::string>& list, const std::string& name) {
    return std::ranges::binary_search(list, name);
  };
  std::set<std::string> suffixes;
  for (const std::string& name : names) {
    if (const auto suffix = suffix_of(name, "scene_camera")) suffixes.insert(*suffix);
    const auto suffix = suffix_of(name, "scene_gt");
    if (suffix && !suffix->starts_with("_info") && !suffix->starts_with("_coco")) {
      suffixes.insert(*suffix);
    }
  }
  if (suffixes.empty() && (has(folders, "rgb") || has(folders, "gray")) &&
      is_number(fs::path(folder).parent_path().filename().string())) {
    suffixes.insert("");
  }
  for (const std::string& suffix : suffixes) {
    BopScene scene{folder, suffix, split, number};
    scene.has_cameras = has(names, "scene_camera" + suffix + ".json");
    scene.has_poses = has(names, "scene_gt" + suffix + ".json");
    scene.has_infos = has(names, "scene_gt_info" + suffix + ".json");
    scene.has_pictures = has(folders, "rgb" + suffix) || has(folders, "gray" + suffix);
    scene.has_depth = has(folders, "depth" + suffix);
    scene.has_masks = has(folders, "mask" + suffix);
    scene.has_visible_masks = has(folders, "mask_visib" + suffix);
    scenes.push_back(std::move(scene));
  }
}

std::string split_of(const std::string& folder) {
  for (const char* split : {"train", "val", "test"}) {
    if (folder.starts_with(split)) return split;
  }
  return {};
}

}  // namespace

std::vector<BopScene> find_bop_scenes(const fs::path& folder) {
  std::vector<BopScene> scenes;
  add_scenes(folder, "", "", 0, scenes);
  if (!scenes.empty()) return scenes;
  for (const std::string& below : names_in(folder, true)) {
    if (is_number(below)) {
      add_scenes(folder, below + "/", split_of(folder.filename().string()), std::stoi(below),
                 scenes);
      continue;
    }
    if (below.starts_with("models")) continue;
    for (const std::string& name : names_in(folder / below, true)) {
      if (!is_number(name)) continue;
      add_scenes(folder, below + "/" + name + "/", split_of(below), std::stoi(name), scenes);
    }
  }
  return scenes;
}

std::vector<BopImage> read_bop_tables(const BopScene& scene, StoredFiles& files,
                                      const BopLook& look_at) {
  std::map<int, BopImage> images;
  const auto number_of = [](const std::string& key) {
    int image = 0;
    const auto parsed = std::from_chars(key.data(), key.data() + key.size(), image);
    if (parsed.ec != std::errc() || parsed.ptr != key.data() + key.size() || image < 0) {
      throw std::runtime_error("'" + key + "' is no image id");
    }
    return image;
  };
  const auto add_list = [&](const char* table, bool is_info) {
    const std::string file = scene.table(table);
    std::string last;
    files.reading(file, [&] {
      visit_json_file(files.root() / file, [&](const std::string& key, bool is_element,
                                               JsonSpan span, std::string_view text) {
        const int id = number_of(key);
        BopImage& image = images[id];
        bool& has = is_info ? image.has_infos : image.has_poses;
        JsonSpan& all = is_info ? image.infos : image.poses;
        if (key != last || !is_element) {
          files.check(!has, kOnce, file, "image " + key, "is there twice");
          all = span;
          if (!is_element) all.length = 0;
        } else {
          const std::uint64_t length = span.offset + span.length - all.offset;
          if (length > std::numeric_limits<std::uint32_t>::max()) {
            throw std::runtime_error("image " + key + " has too many entries");
          }
          all.length = std::uint32_t(length);
        }
        has = true;
        last = key;
        if (is_element) look_at(is_info, id, text);
      });
    });
  };
  if (scene.has_cameras) {
    const std::string file = scene.table("scene_camera");
    files.reading(file, [&] {
      visit_json_file(files.root() / file, [&](const std::string& key, bool is_element,
                                               JsonSpan span, std::string_view) {
        if (is_element) throw std::runtime_error("image " + key + " is a list");
        BopImage& image = images[number_of(key)];
        files.check(image.camera_entry.length == 0, kOnce, file, "image " + key, "is there twice");
        image.camera_entry = span;
      });
    });
  }
  if (scene.has_poses) add_list("scene_gt", false);
  if (scene.has_infos) add_list("scene_gt_info", true);
  if (!scene.has_cameras && !scene.has_poses) {
    for (const char* kind : {"rgb", "gray"}) {
      for (const ListedPicture& picture : pictures_in(files.root() / scene.place(kind, ""), 0)) {
        if (is_number(picture.stem)) images.try_emplace(std::stoi(picture.stem));
      }
    }
  }
  std::vector<BopImage> result;
  for (auto& [id, image] : images) {
    image.image = id;
    const std::string who = "image " + std::to_string(id);
    if (scene.has_cameras) {
      files.check(image.camera_entry.length > 0, kMissing, scene.table("scene_camera"), who,
                  "has no entry", "one, as other tables have it");
    }
    if (scene.has_poses) {
      files.check(image.has_poses, kMissing, scene.table("scene_gt"), who, "has no entry",
                  "one, as other tables have it");
    }
    if (scene.has_infos) {
      files.check(image.has_infos, kMissing, scene.table("scene_gt_info"), who, "has no entry",
                  "one, as other tables have it");
    }
    result.push_back(image);
  }
  return result;
}

}  // namespace diorama
