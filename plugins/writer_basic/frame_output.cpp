// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/frame_output.h"

#include "writer_support/replicator.h"

namespace diorama {

std::string FrameNaming::path(const Frame& frame, std::string_view annotator, std::string_view stem,
                              std::string_view ending) const {
  const std::string name = std::string(stem) + "_" + number + std::string(ending);
  if (!has_many_cameras) return name;
  const std::string product = render_product_name(frame);
  if (use_common_output_dir) return std::string(annotator) + "/" + product + "_" + name;
  return product + "/" + std::string(annotator) + "/" + name;
}

Image<std::uint32_t> instance_picture(const Frame& frame,
                                      const std::map<std::uint32_t, std::uint32_t>& picture_ids) {
  const auto& leaves = frame.get(kLeafId);
  Image<std::uint32_t> picture = frame.get(kInstanceId);
  // Neighbours are mostly equal: look up once per run.
  std::uint32_t last_id = 0;
  std::uint32_t last_picture_id = kUnlabelledId;
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    std::uint32_t& pixel = picture.pixels()[i];
    if (pixel != last_id) {
      last_id = pixel;
      const auto found = picture_ids.find(pixel);
      last_picture_id = found == picture_ids.end() ? kUnlabelledId : found->second;
    }
    pixel = leaves.pixels()[i] == 0 ? kBackgroundId : last_picture_id;
  }
  return picture;
}

std::map<std::uint32_t, std::uint32_t> semantic_picture_ids(const FrameOutput& output) {
  std::map<std::uint32_t, std::uint32_t> ids;
  for (const FilteredInstance& filtered : output.instances) {
    ids.emplace(filtered.instance->id, output.semantic_ids.at(filtered.labels));
  }
  return ids;
}

std::map<std::uint32_t, std::uint32_t> instance_picture_ids(const FrameOutput& output) {
  std::map<std::uint32_t, std::uint32_t> ids;
  for (std::size_t i = 0; i < output.instances.size(); ++i) {
    ids.emplace(output.instances[i].instance->id, instance_picture_id(i));
  }
  return ids;
}

}  // namespace diorama
