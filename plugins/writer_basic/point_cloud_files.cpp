// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/point_cloud_files.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "writer_support/npy.h"

namespace diorama {
namespace {

/// Numbers of the pixels that are points.
std::vector<std::uint32_t> point_pixels(const Image<std::uint32_t>& semantic,
                                        bool include_unlabelled) {
  std::vector<std::uint32_t> chosen;
  chosen.reserve(semantic.pixels().size());
  for (std::uint32_t i = 0; i < semantic.pixels().size(); ++i) {
    const std::uint32_t id = semantic.pixels()[i];
    if (id == kBackgroundId || (id == kUnlabelledId && !include_unlabelled)) continue;
    chosen.push_back(i);
  }
  return chosen;
}

/// Adds an array of value_of(pixel) for all points, a part at a time.
template <class Function>
void add_array(const FrameOutput& output, std::string_view stem, std::string_view descr,
               std::span<const std::int64_t> shape, const std::vector<std::uint32_t>& pixels,
               const Function& value_of) {
  constexpr std::size_t kPart = 1 << 16;
  const std::string path = output.path("pointcloud", stem, ".npy");
  output.files.append(path, npy_header(descr, shape));
  std::vector<decltype(value_of(0u))> values;
  for (std::size_t begin = 0; begin < pixels.size(); begin += kPart) {
    values.clear();
    for (std::size_t i = begin; i < std::min(begin + kPart, pixels.size()); ++i) {
      values.push_back(value_of(pixels[i]));
    }
    output.files.append(path, std::as_bytes(std::span(values)));
  }
}

}  // namespace

void write_point_cloud(const FrameOutput& output, bool include_unlabelled) {
  const Frame& frame = output.frame;
  const auto positions = frame.get(kPosition).pixels();
  const auto colors = frame.get(kColor).pixels();
  const auto normals = frame.get(kNormals).pixels();
  const auto semantic = instance_picture(frame, semantic_picture_ids(output));
  const auto instance = instance_picture(frame, instance_picture_ids(output));
  const std::vector<std::uint32_t> points = point_pixels(semantic, include_unlabelled);
  const auto count = std::int64_t(points.size());

  const auto add = [&](std::string_view stem, std::string_view descr,
                       std::initializer_list<std::int64_t> shape, const auto& value_of) {
    add_array(output, stem, descr, std::span(shape.begin(), shape.size()), points, value_of);
  };
  add("pointcloud", "'<f4'", {count, 3}, [&](std::uint32_t i) { return positions[i]; });
  add("pointcloud_rgb", "'|u1'", {count, 4}, [&](std::uint32_t i) { return colors[i]; });
  add("pointcloud_normals", "'<f4'", {count, 4}, [&](std::uint32_t i) {
    const Vec3f& n = normals[i];
    return std::array{n.x(), n.y(), n.z(), 1.0f};
  });
  add("pointcloud_semantic", "'<u4'", {count},
      [&](std::uint32_t i) { return semantic.pixels()[i]; });
  add("pointcloud_instance", "'<u4'", {count},
      [&](std::uint32_t i) { return instance.pixels()[i]; });
}

}  // namespace diorama
