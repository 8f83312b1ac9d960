// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "diorama/reader.h"
#include "reader_support/dataset_page.h"
#include "reader_support/json_elements.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// A category as annotation files list it.
struct StoredCategory {
  std::string name;
  bool is_thing = true;  ///< Something that is counted; else a region.
  std::size_t keypoint_count = 0;
  StoredSkeleton skeleton;
  bool has_cuboid_keypoints = false;  ///< Middle and corners of a 3-D box, as our writer has them.
};

/// One annotation file: "annotations/instances_train.json".
struct CocoPart {
  std::string file;
  std::string split;     ///< Empty: the file's name says none.
  std::string panoptic;  ///< "annotations/panoptic_train.json"; empty: there is none.
  std::map<std::int64_t, StoredCategory> categories;
};

/// Where an image, its annotations and its panoptic entry stand. Small, as there may be millions.
struct CocoImageEntry {
  std::int64_t id = 0;
  JsonSpan span;
  JsonSpan panoptic;  ///< Length 0: none.
  std::uint32_t first_annotation = 0;
  std::uint32_t annotation_count = 0;
  std::int32_t capture = 0;
  std::uint16_t part = 0;
  std::uint16_t camera = 0;
};

/// What a COCO folder lists, without the annotations themselves.
struct CocoTables {
  std::vector<CocoPart> parts;
  std::vector<CocoImageEntry> images;  ///< By capture, then by camera.
  std::vector<JsonSpan> annotations;   ///< By image.
  std::vector<std::string> cameras;
  std::vector<std::string> classes;
  bool has_captures = false;  ///< Images name capture and camera.
  bool has_cameras = false;   ///< Images have intrinsics and poses.
  bool has_lossy_pictures = false;
  bool has_masks = false;
  bool has_amodal = false;
  bool has_nodes = false;
  bool has_keypoints = false;
  bool has_tracks = false;
  bool has_own_categories = false;  ///< With colours, supercategories or ids that leave gaps.
};

/// Walks through all annotation files; what is wrong with them goes to the log. Throws Error(Asset)
/// when there is none that can be read.
CocoTables read_coco_tables(const std::filesystem::path& folder,
                            const std::optional<DatasetPage>& page, StoredFiles& files);

/// The annotation files of a folder: file, split.
std::vector<CocoPart> find_coco_parts(const std::filesystem::path& folder);

}  // namespace diorama
