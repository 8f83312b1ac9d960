// SPDX-License-Identifier: Apache-2.0
#include "writer_imagefolder/image_folder_writer.h"

#include <string>
#include <string_view>

#include "writer_support/clips_json.h"

namespace diorama {
namespace {

/// The library's name of a split of ours.
std::string folder_of(std::string_view split) {
  return split == "val" ? "validation" : std::string(split);
}

std::string card(const std::vector<std::string>& splits, const std::vector<std::string>& classes) {
  std::string text =
      "---\ntask_categories:\n- object-detection\nconfigs:\n- config_name: default\n"
      "  data_files:\n";
  for (const std::string& split : splits) {
    text += "  - split: " + folder_of(split) + "\n    path: \"" + folder_of(split) + "/**\"\n";
  }
  text += "---\n\nRendered by Diorama. `objects.categories` are:\n\n";
  for (std::size_t i = 0; i < classes.size(); ++i) {
    text += std::to_string(i) + ". " + classes[i] + "\n";
  }
  return text;
}

}  // namespace

NameSet ImageFolderWriter::needs() const {
  NameSet names{std::string(kColor.name), "instances", "visibility"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
  return names;
}

void ImageFolderWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  files.add_text("README.md", card(training_.splits(), training_.classes()));
  training_.add_dataset_page("Hugging Face image folder",
                             {{"boxes", "x, y, width, height in pixels, from the top left corner"},
                              {"categories", "places in the list of classes, from 0"}},
                             dataset, files);
}

std::string ImageFolderWriter::metadata_line(const Capture& capture, std::size_t camera,
                                             const std::string& file) const {
  const Frame& frame = capture.frames[camera];
  Json objects{{"bbox", Json::array()},
               {"categories", Json::array()},
               {"area", Json::array()},
               {"id", Json::array()},
               {"visible_share", Json::array()}};
  if (!params_.training.masks) {
    objects.erase("area");
    objects.erase("visible_share");
  }
  for (const TrainingObject& object : training_.objects(frame)) {
    const Instance& instance = *object.instance;
    const PixelBox& box = *instance.tight_box;
    const double hidden =
        instance.visibility ? instance.visibility->occlusion().value_or(0.0) : 0.0;
    objects["bbox"].push_back({box.x_min, box.y_min, box.width(), box.height()});
    objects["categories"].push_back(object.class_index);
    objects["id"].push_back(instance.id);
    if (!params_.training.masks) continue;
    objects["area"].push_back(object.visible_px);
    objects["visible_share"].push_back(python_round(1.0 - hidden, 6));
  }
  Json row{{"file_name", file},
           {"image_id", capture.index * training_.camera_count() + int(camera)},
           {"width", frame.camera.width},
           {"height", frame.camera.height},
           {"capture", capture.index},
           {"camera", frame.camera_name}};
  add_clip_frame(capture, row);
  row["objects"] = std::move(objects);
  return python_json(row);
}

/// The record is the lines of metadata.jsonl, a tab behind each: no JSON text holds one.
void ImageFolderWriter::write(const Capture& capture, CaptureFiles& files) const {
  const std::string folder = folder_of(training_.split(capture.index)) + "/";
  std::string record;
  for (std::size_t camera = 0; camera < capture.frames.size(); ++camera) {
    const Frame& frame = capture.frames[camera];
    const std::string file = training_.image_stem(capture, frame) + "." + training_.image_format();
    files.add(folder + file, training_.image_file(host_, frame));
    record += metadata_line(capture, camera, file) + "\t";
  }
  files.record(record);
}

void ImageFolderWriter::finish(const RecordReader& records, DatasetFiles& files) {
  for (const std::string& split : training_.splits()) {
    files.append_text(folder_of(split) + "/metadata.jsonl", "");
  }
  records([&](int capture, std::string_view line) {
    const std::string path = folder_of(training_.split(capture)) + "/metadata.jsonl";
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t end = line.find('\t', at);
      files.append_text(path, std::string(line.substr(at, end - at)) + "\n");
      if (end == std::string_view::npos) break;
      at = end + 1;
    }
  });
}

}  // namespace diorama
