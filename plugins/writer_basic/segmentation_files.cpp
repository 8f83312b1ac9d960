// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/segmentation_files.h"

#include <bit>
#include <set>

#include "writer_support/image_files.h"
#include "writer_support/segmentation_colors.h"

namespace diorama {
namespace {

std::set<std::uint32_t> values_of(const Image<std::uint32_t>& picture) {
  std::set<std::uint32_t> values;
  std::uint32_t last = 0;
  bool is_first = true;
  for (const std::uint32_t value : picture.pixels()) {
    if (!is_first && value == last) continue;
    is_first = false;
    last = value;
    values.insert(value);
  }
  return values;
}

/// A picture of ids and the keys by which its JSON files name them.
class Segmentation {
 public:
  /// `always` are listed whether the picture holds them or not.
  Segmentation(Image<std::uint32_t> picture, bool colorize, std::set<std::uint32_t> always)
      : picture_(std::move(picture)), colorize_(colorize), ids_(values_of(picture_)) {
    ids_.merge(always);
    if (colorize_) colors_ = distinct_colors(ids_);
  }

  const std::set<std::uint32_t>& ids() const { return ids_; }

  std::string key(std::uint32_t id) const {
    return colorize_ ? color_text(colors_.at(id)) : std::to_string(id);
  }

  /// Uses the picture up: the colours take its place.
  std::vector<std::byte> file(const Host& host, const std::string& path) {
    if (!colorize_) return png_file(host, picture_, path);
    std::uint32_t last = 0;
    auto color = std::bit_cast<std::uint32_t>(segmentation_color(last));
    for (std::uint32_t& pixel : picture_.pixels()) {
      if (pixel != last) {
        last = pixel;
        color = std::bit_cast<std::uint32_t>(colors_.at(last));
      }
      pixel = color;
    }
    return host.encode_image({picture_.pixels().data(), picture_.width(), picture_.height(), 4, 8},
                             ImageFormat::Png);
  }

 private:
  Image<std::uint32_t> picture_;
  bool colorize_;
  std::set<std::uint32_t> ids_;
  std::map<std::uint32_t, Rgba8> colors_;
};

void add_picture(const FrameOutput& output, std::string_view name, Segmentation& picture) {
  const std::string path = output.path(name, name, ".png");
  output.files.add(path, picture.file(output.host, path));
}

void add_mapping(const FrameOutput& output, std::string_view name, std::string_view stem,
                 const Json& json) {
  output.files.add_text(output.path(name, stem, ".json"), python_json(json));
}

Json class_json(const char* text) { return Json{{"class", text}}; }

}  // namespace

void write_semantic_segmentation(const FrameOutput& output, bool colorize) {
  constexpr std::string_view kName = "semantic_segmentation";
  Segmentation picture(instance_picture(output.frame, semantic_picture_ids(output)), colorize,
                       {kBackgroundId, kUnlabelledId});
  add_picture(output, kName, picture);

  Json labels = Json::object();
  labels[picture.key(kBackgroundId)] = class_json("BACKGROUND");
  labels[picture.key(kUnlabelledId)] = class_json("UNLABELLED");
  for (const auto& [set, id] : output.semantic_ids) {
    if (picture.ids().contains(id)) labels[picture.key(id)] = labels_json(set);
  }
  add_mapping(output, kName, "semantic_segmentation_labels", labels);
}

void write_instance_segmentation(const FrameOutput& output, bool colorize) {
  constexpr std::string_view kName = "instance_segmentation";
  Segmentation picture(instance_picture(output.frame, instance_picture_ids(output)), colorize,
                       {kBackgroundId, kUnlabelledId});
  add_picture(output, kName, picture);

  Json paths = Json::object();
  Json labels = Json::object();
  paths[picture.key(kBackgroundId)] = "BACKGROUND";
  labels[picture.key(kBackgroundId)] = class_json("BACKGROUND");
  paths[picture.key(kUnlabelledId)] = "UNLABELLED";
  labels[picture.key(kUnlabelledId)] = class_json("UNLABELLED");
  for (std::size_t i = 0; i < output.instances.size(); ++i) {
    const std::uint32_t id = instance_picture_id(i);
    if (!picture.ids().contains(id)) continue;
    paths[picture.key(id)] = output.instances[i].instance->node_path;
    labels[picture.key(id)] = labels_json(output.instances[i].labels);
  }
  add_mapping(output, kName, "instance_segmentation_mapping", paths);
  add_mapping(output, kName, "instance_segmentation_semantics_mapping", labels);
}

void write_instance_id_segmentation(const FrameOutput& output, bool colorize,
                                    const std::string& no_instance_text) {
  constexpr std::string_view kName = "instance_id_segmentation";
  // Moved up by one, so that no leaf has the colour of kUnlabelledId.
  Image<std::uint32_t> ids = output.frame.get(kLeafId);
  for (std::uint32_t& id : ids.pixels()) id = id == 0 ? kBackgroundId : id + 1;
  Segmentation picture(std::move(ids), colorize, {kBackgroundId});
  add_picture(output, kName, picture);

  Json paths = Json::object();
  paths[picture.key(kBackgroundId)] = no_instance_text;
  for (const auto& [leaf, path] : output.frame.leaf_paths) {
    if (picture.ids().contains(leaf + 1)) paths[picture.key(leaf + 1)] = path;
  }
  add_mapping(output, kName, "instance_id_segmentation_mapping", paths);
}

}  // namespace diorama
