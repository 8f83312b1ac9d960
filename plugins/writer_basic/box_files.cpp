// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/box_files.h"

#include "writer_support/camera_matrices.h"
#include "writer_support/npy.h"

namespace diorama {
namespace {

constexpr std::string_view kBox2dType =
    "[('semanticId', '<u4'), ('x_min', '<i4'), ('y_min', '<i4'), ('x_max', '<i4'), "
    "('y_max', '<i4'), ('occlusionRatio', '<f4')]";
constexpr std::string_view kBox3dType =
    "[('semanticId', '<u4'), ('x_min', '<f4'), ('y_min', '<f4'), ('z_min', '<f4'), "
    "('x_max', '<f4'), ('y_max', '<f4'), ('z_max', '<f4'), ('transform', '<f4', (4, 4)), "
    "('occlusionRatio', '<f4')]";
constexpr std::string_view kOcclusionType =
    "[('instanceId', '<u4'), ('semanticId', '<u4'), ('occlusionRatio', '<f4')]";

/// -1 where it is not known.
float occlusion_ratio(const Instance& instance) {
  if (!instance.visibility) return -1.0f;
  return float(instance.visibility->occlusion().value_or(-1.0));
}

bool is_in_image(const Instance& instance) {
  return instance.tight_box || (instance.visibility && instance.visibility->amodal_pixels > 0);
}

/// Box ids count from 0 over the label sets of one file.
std::map<Labels, std::uint32_t> box_ids(const std::vector<FilteredInstance>& rows) {
  std::map<Labels, std::uint32_t> ids;
  for (const FilteredInstance& row : rows) ids.emplace(row.labels, 0);
  std::uint32_t next = 0;
  for (auto& [labels, id] : ids) id = next++;
  return ids;
}

/// The array, the labels of its ids and the path of each row.
void add_box_files(const FrameOutput& output, const std::string& name, std::string_view type,
                   const std::vector<FilteredInstance>& rows, const PackedBytes& array) {
  Json labels = Json::object();
  for (const auto& [set, id] : box_ids(rows)) labels[std::to_string(id)] = labels_json(set);
  Json paths = Json::array();
  for (const FilteredInstance& row : rows) paths.push_back(row.instance->node_path);
  output.files.add(output.path(name, name, ".npy"),
                   npy_file(type, {std::int64_t(rows.size())}, array.bytes));
  output.files.add_text(output.path(name, name + "_labels", ".json"), python_json(labels));
  output.files.add_text(output.path(name, name + "_prim_paths", ".json"), python_json(paths));
}

template <class BoxOf>
void write_boxes_2d(const FrameOutput& output, const std::string& name, BoxOf box_of) {
  std::vector<FilteredInstance> rows;
  for (const FilteredInstance& filtered : output.instances) {
    if (box_of(*filtered.instance)) rows.push_back(filtered);
  }
  const std::map<Labels, std::uint32_t> ids = box_ids(rows);
  PackedBytes array;
  for (const FilteredInstance& row : rows) {
    const PixelBox box = *box_of(*row.instance);
    array.add_u32(ids.at(row.labels));
    array.add_i32(box.x_min);
    array.add_i32(box.y_min);
    array.add_i32(box.x_max - 1);  // the format names the last pixel
    array.add_i32(box.y_max - 1);
    array.add_f32(occlusion_ratio(*row.instance));
  }
  add_box_files(output, name, kBox2dType, rows, array);
}

}  // namespace

void write_bounding_box_2d_tight(const FrameOutput& output) {
  write_boxes_2d(output, "bounding_box_2d_tight",
                 [](const Instance& instance) { return instance.tight_box; });
}

void write_bounding_box_2d_loose(const FrameOutput& output) {
  write_boxes_2d(output, "bounding_box_2d_loose", [](const Instance& instance) {
    return instance.visibility ? instance.visibility->amodal_box : std::nullopt;
  });
}

void write_bounding_box_3d(const FrameOutput& output) {
  std::vector<FilteredInstance> rows;
  for (const FilteredInstance& filtered : output.instances) {
    if (is_in_image(*filtered.instance)) rows.push_back(filtered);
  }
  const std::map<Labels, std::uint32_t> ids = box_ids(rows);
  PackedBytes array;
  for (const FilteredInstance& row : rows) {
    const Instance& instance = *row.instance;
    array.add_u32(ids.at(row.labels));
    for (int axis = 0; axis < 3; ++axis) array.add_f32(float(instance.bounds_node.min[axis]));
    for (int axis = 0; axis < 3; ++axis) array.add_f32(float(instance.bounds_node.max[axis]));
    const Mat4 transform = row_vector_matrix(instance.world_from_node);
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) array.add_f32(float(transform(r, c)));
    }
    array.add_f32(occlusion_ratio(instance));
  }
  add_box_files(output, "bounding_box_3d", kBox3dType, rows, array);
}

void write_occlusion(const FrameOutput& output) {
  PackedBytes array;
  std::int64_t count = 0;
  for (std::size_t i = 0; i < output.instances.size(); ++i) {
    const FilteredInstance& filtered = output.instances[i];
    if (!is_in_image(*filtered.instance)) continue;
    ++count;
    array.add_u32(instance_picture_id(i));
    array.add_u32(output.semantic_ids.at(filtered.labels));
    array.add_f32(occlusion_ratio(*filtered.instance));
  }
  output.files.add(output.path("occlusion", "occlusion", ".npy"),
                   npy_file(kOcclusionType, {count}, array.bytes));
}

}  // namespace diorama
