// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "reader_support/json_elements.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// One camera's pictures of a scene: of several that share a folder, the one with this suffix.
struct BopScene {
  std::string folder;  ///< With a '/' behind; empty: the dataset's own.
  std::string suffix;  ///< "", or "_cam_0" behind the names of folders and tables.
  std::string split;   ///< "train", "val", "test"; empty when the folder says none.
  int number = 0;      ///< Of the folder.
  bool has_cameras = false;
  bool has_poses = false;
  bool has_infos = false;
  bool has_pictures = false;
  bool has_depth = false;
  bool has_masks = false;
  bool has_visible_masks = false;

  std::string table(const char* name) const { return folder + name + suffix + ".json"; }
  std::string place(const char* kind, const std::string& name) const {
    return folder + kind + suffix + "/" + name;
  }
};

/// Where a picture's entries stand in the tables of its scene; length 0: there is none, or an empty
/// one.
struct BopImage {
  std::uint32_t scene = 0;
  std::int32_t image = 0;  ///< im_id
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
  JsonSpan camera_entry;
  JsonSpan poses;  ///< From the first element to the last one.
  JsonSpan infos;
  bool has_poses = false;
  bool has_infos = false;
};

/// Scenes of the splits in a folder, of a folder of scenes, or the folder as a scene; sorted.
std::vector<BopScene> find_bop_scenes(const std::filesystem::path& folder);

/// Pictures of a scene, by im_id. `look_at(table, image, text)` sees each element of scene_gt and
/// scene_gt_info. What is wrong with tables is a finding.
using BopLook = std::function<void(bool is_info, int image, std::string_view text)>;
std::vector<BopImage> read_bop_tables(const BopScene& scene, StoredFiles& files,
                                      const BopLook& look_at);

}  // namespace diorama
