// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/basic_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <set>
#include <system_error>

#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// A file of an annotator: the folder it lies in, the front of its name, its ending.
struct Kind {
  std::string_view annotator;
  std::string_view stem;
  std::string_view ending;
};

constexpr std::array kKinds{
    Kind{"rgb", "rgb", ".png"},
    Kind{"rgb", "rgb", ".jpg"},
    Kind{"rgb", "rgb", ".jpeg"},
    Kind{"rgb", "rgb", ".exr"},
    Kind{"normals", "normals", ".png"},
    Kind{"distance_to_camera", "distance_to_camera", ".npy"},
    Kind{"distance_to_camera", "distance_to_camera", ".png"},
    Kind{"distance_to_image_plane", "distance_to_image_plane", ".npy"},
    Kind{"distance_to_image_plane", "distance_to_image_plane", ".png"},
    Kind{"sensor_depth", "sensor_depth", ".npy"},
    Kind{"sensor_depth", "sensor_depth", ".png"},
    Kind{"semantic_segmentation", "semantic_segmentation", ".png"},
    Kind{"semantic_segmentation", "semantic_segmentation_labels", ".json"},
    Kind{"instance_id_segmentation", "instance_id_segmentation", ".png"},
    Kind{"instance_id_segmentation", "instance_id_segmentation_mapping", ".json"},
    Kind{"instance_segmentation", "instance_segmentation", ".png"},
    Kind{"instance_segmentation", "instance_segmentation_mapping", ".json"},
    Kind{"instance_segmentation", "instance_segmentation_semantics_mapping", ".json"},
    Kind{"bounding_box_2d_tight", "bounding_box_2d_tight", ".npy"},
    Kind{"bounding_box_2d_tight", "bounding_box_2d_tight_labels", ".json"},
    Kind{"bounding_box_2d_tight", "bounding_box_2d_tight_prim_paths", ".json"},
    Kind{"bounding_box_2d_loose", "bounding_box_2d_loose", ".npy"},
    Kind{"bounding_box_2d_loose", "bounding_box_2d_loose_labels", ".json"},
    Kind{"bounding_box_2d_loose", "bounding_box_2d_loose_prim_paths", ".json"},
    Kind{"bounding_box_3d", "bounding_box_3d", ".npy"},
    Kind{"bounding_box_3d", "bounding_box_3d_labels", ".json"},
    Kind{"bounding_box_3d", "bounding_box_3d_prim_paths", ".json"},
    Kind{"occlusion", "occlusion", ".npy"},
    Kind{"motion_vectors", "motion_vectors", ".npy"},
    Kind{"flow_forward", "flow_forward", ".npy"},
    Kind{"flow_backward", "flow_backward", ".npy"},
    Kind{"flow_forward_state", "flow_forward_state", ".npy"},
    Kind{"flow_backward_state", "flow_backward_state", ".npy"},
    Kind{"velocities", "velocities", ".json"},
    Kind{"camera_params", "camera_params", ".json"},
    Kind{"joint_states", "joint_states", ".json"},
    Kind{"pointcloud", "pointcloud", ".npy"},
    Kind{"pointcloud", "pointcloud_rgb", ".npy"},
    Kind{"pointcloud", "pointcloud_normals", ".npy"},
    Kind{"pointcloud", "pointcloud_semantic", ".npy"},
    Kind{"pointcloud", "pointcloud_instance", ".npy"}};
static_assert(kKinds.size() <= 64, "one bit each");

std::string name_of(const Kind& kind) { return std::string(kind.stem) + std::string(kind.ending); }

std::size_t kind_index(std::string_view name) {
  return std::size_t(
      std::ranges::find_if(kKinds, [&](const Kind& kind) { return name_of(kind) == name; }) -
      kKinds.begin());
}

bool is_annotator(const std::string& name) {
  return std::ranges::find(kKinds, name, &Kind::annotator) != kKinds.end();
}

}  // namespace

BasicFiles::BasicFiles(const fs::path& folder) {
  for (const std::string& name : names_in(folder)) take("", Layout::Flat, name);
  for (const std::string& below : names_in(folder, true)) {
    if (is_annotator(below)) {
      for (const std::string& name : names_in(folder / below)) {
        take("", Layout::FolderPerAnnotator, name);
      }
      continue;
    }
    for (const std::string& annotator : names_in(folder / below, true)) {
      if (!is_annotator(annotator)) continue;
      for (const std::string& name : names_in(folder / below / annotator)) {
        take(below, Layout::FolderPerProduct, name);
      }
    }
  }
}

void BasicFiles::take(const std::string& product, Layout layout, const std::string& name) {
  const fs::path path(name);
  const std::string stem = path.stem().string();
  const std::size_t cut = stem.rfind('_');
  if (cut == stem.npos) return;
  int number = 0;
  const char* begin = stem.data() + cut + 1;
  const char* end = stem.data() + stem.size();
  const auto parsed = std::from_chars(begin, end, number);
  if (parsed.ec == std::errc::result_out_of_range && parsed.ptr == end) {
    if (unnumbered_.size() < 100) unnumbered_.push_back(name);
    return;
  }
  if (parsed.ec != std::errc() || parsed.ptr != end || *begin == '-') return;
  const std::string front = stem.substr(0, cut);
  const std::string ending = path.extension().string();
  // The longest name wins where one ends with another.
  std::size_t best = kKinds.size();
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    const std::string_view own = kKinds[i].stem;
    const bool fits =
        kKinds[i].ending == ending && (front == own || (layout == Layout::FolderPerAnnotator &&
                                                        front.ends_with("_" + std::string(own))));
    if (fits && (best == kKinds.size() || own.size() > kKinds[best].stem.size())) best = i;
  }
  if (best == kKinds.size()) return;
  std::string owner = product;
  if (layout == Layout::FolderPerAnnotator && front.size() > kKinds[best].stem.size()) {
    owner = front.substr(0, front.size() - kKinds[best].stem.size() - 1);
  }
  Product& own = products_[owner];
  own.layout = layout;
  Entry& entry = own.frames[number];
  entry.kinds |= std::uint64_t(1) << best;
  entry.digits = std::uint8_t(std::min<std::ptrdiff_t>(end - begin, 20));
  kinds_ |= std::uint64_t(1) << best;
}

std::vector<std::string> BasicFiles::products() const {
  std::vector<std::string> names;
  for (const auto& [name, product] : products_) names.push_back(name);
  return names;
}

std::vector<int> BasicFiles::numbers() const {
  std::set<int> numbers;
  for (const auto& [name, product] : products_) {
    for (const auto& [number, entry] : product.frames) numbers.insert(numbers.end(), number);
  }
  return {numbers.begin(), numbers.end()};
}

std::vector<std::string> BasicFiles::kinds() const {
  std::vector<std::string> kinds;
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    if ((kinds_ >> i & 1) != 0) kinds.push_back(name_of(kKinds[i]));
  }
  return kinds;
}

bool BasicFiles::has(std::string_view kind) const {
  const std::size_t index = kind_index(kind);
  return index < kKinds.size() && (kinds_ >> index & 1) != 0;
}

std::string BasicFiles::nameless_boxes() const {
  if (has_node_paths()) return {};
  for (const char* name : {"bounding_box_2d_tight", "bounding_box_2d_loose", "bounding_box_3d"}) {
    if (has(std::string(name) + ".npy")) return name;
  }
  return {};
}

bool BasicFiles::has_node_paths() const {
  return has("instance_segmentation_mapping.json") ||
         has("bounding_box_2d_tight_prim_paths.json") ||
         has("bounding_box_2d_loose_prim_paths.json") || has("bounding_box_3d_prim_paths.json");
}

std::string BasicFiles::path_of(const std::string& product, const Product& own, int number,
                                std::size_t kind) const {
  std::size_t digits = 4;
  if (!own.frames.empty()) digits = own.frames.begin()->second.digits;
  if (const auto frame = own.frames.find(number); frame != own.frames.end()) {
    digits = frame->second.digits;
  }
  const Kind& of = kKinds[kind];
  const std::string name =
      std::string(of.stem) + "_" + zero_padded(number, digits) + std::string(of.ending);
  const std::string annotator(of.annotator);
  switch (own.layout) {
    case Layout::FolderPerProduct:
      return product + "/" + annotator + "/" + name;
    case Layout::FolderPerAnnotator:
      return annotator + "/" + (product.empty() ? "" : product + "_") + name;
    case Layout::Flat:
      break;
  }
  return name;
}

std::string BasicFiles::path(const std::string& product, int number, std::string_view kind) const {
  const std::size_t index = kind_index(kind);
  const auto own = products_.find(product);
  if (own == products_.end() || index == kKinds.size()) return {};
  const auto frame = own->second.frames.find(number);
  if (frame == own->second.frames.end() || (frame->second.kinds >> index & 1) == 0) return {};
  return path_of(product, own->second, number, index);
}

std::string BasicFiles::expected_path(const std::string& product, int number,
                                      std::string_view kind) const {
  const std::size_t index = kind_index(kind);
  const auto own = products_.find(product);
  if (own == products_.end() || index == kKinds.size()) return {};
  return path_of(product, own->second, number, index);
}

}  // namespace diorama
