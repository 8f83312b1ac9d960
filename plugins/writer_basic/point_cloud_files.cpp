// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/point_cloud_files.h"

#include "writer_support/npy.h"

namespace diorama {

void write_point_cloud(const FrameOutput& output, bool include_unlabelled) {
  const Frame& frame = output.frame;
  const auto& positions = frame.get(kPosition);
  const auto& colors = frame.get(kColor);
  const auto& normals = frame.get(kNormals);
  const auto semantic = instance_picture(frame, semantic_picture_ids(output));
  const auto instance = instance_picture(frame, instance_picture_ids(output));

  std::int64_t count = 0;
  PackedBytes points, point_colors, point_normals, point_semantics, point_instances;
  for (std::size_t i = 0; i < semantic.pixels().size(); ++i) {
    const std::uint32_t id = semantic.pixels()[i];
    if (id == kBackgroundId || (id == kUnlabelledId && !include_unlabelled)) continue;
    ++count;
    for (int axis = 0; axis < 3; ++axis) points.add_f32(positions.pixels()[i][axis]);
    for (const std::uint8_t value : colors.pixels()[i]) point_colors.add_u8(value);
    for (int axis = 0; axis < 3; ++axis) point_normals.add_f32(normals.pixels()[i][axis]);
    point_normals.add_f32(1.0f);
    point_semantics.add_u32(id);
    point_instances.add_u32(instance.pixels()[i]);
  }

  constexpr std::string_view kName = "pointcloud";
  const auto add = [&](std::string_view stem, std::vector<std::byte> file) {
    output.files.add(output.path(kName, stem, ".npy"), std::move(file));
  };
  add("pointcloud", npy_file("'<f4'", {count, 3}, points.bytes));
  add("pointcloud_rgb", npy_file("'|u1'", {count, 4}, point_colors.bytes));
  add("pointcloud_normals", npy_file("'<f4'", {count, 4}, point_normals.bytes));
  add("pointcloud_semantic", npy_file("'<u4'", {count}, point_semantics.bytes));
  add("pointcloud_instance", npy_file("'<u4'", {count}, point_instances.bytes));
}

}  // namespace diorama
