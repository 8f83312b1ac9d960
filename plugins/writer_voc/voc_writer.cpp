// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/voc_writer.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <sstream>

#include "writer_support/image_files.h"
#include "writer_support/replicator.h"
#include "writer_voc/class_list_names.h"

namespace diorama {
namespace {

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

/// The benchmark's colours: the index's bits dealt to red, green and blue, the highest first.
std::vector<std::array<std::uint8_t, 3>> voc_palette() {
  std::vector<std::array<std::uint8_t, 3>> palette(256);
  for (unsigned index = 0; index < 256; ++index) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      palette[index][bit % 3] =
          std::uint8_t(palette[index][bit % 3] | (((index >> bit) & 1u) << (7 - bit / 3)));
    }
  }
  return palette;
}

// What the list of a class says of a picture.
constexpr char kShown = 's';
constexpr char kDifficult = 'd';
constexpr char kAbsent = '-';

const char* list_mark(char occurrence) {
  return occurrence == kShown ? "  1\n" : occurrence == kDifficult ? "  0\n" : " -1\n";
}

std::string element(const char* name, const std::string& text) {
  return "<" + std::string(name) + ">" + text + "</" + name + ">";
}

}  // namespace

void VocWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  training.visit_masks(v);
  v.param("segmentation", segmentation, {"Class and object pictures, of masks."});
  v.param("difficult_below", difficult_below,
          {"Objects with a smaller visible share are marked difficult.", "", 0.0, 1.0});
}

VocWriter::VocWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {
  params_.segmentation = params_.segmentation && params_.training.masks;
}

NameSet VocWriter::needs() const {
  NameSet names{std::string(kColor.name), "instances", "visibility"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
  return names;
}

void VocWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  if (params_.segmentation && training_.classes().size() > 255) {
    throw Error(ErrorKind::Config, "segmentation: " + std::to_string(training_.classes().size()) +
                                       " classes; 8-bit pictures have room for 255");
  }
  std::string labels;
  for (const std::string& name : training_.classes()) labels += name + "\n";
  files.add_text("labels.txt", labels);
  for (const char* kind : {"Main", "Segmentation"}) {
    if (!params_.segmentation && std::string_view(kind) == "Segmentation") continue;
    add_image_sets(std::string("ImageSets/") + kind + "/", dataset, files);
  }
  training_.add_dataset_page(
      "Pascal VOC",
      {{"boxes", "pixels counted from 1, the last one included"},
       {"segmentation", "8-bit palette: class index + 1 or object's place + 1, 0 is background"}},
      dataset, files);
}

void VocWriter::add_image_sets(const std::string& folder, const DatasetInfo& dataset,
                               DatasetFiles& files) const {
  for (const char* part : {"train", "val", "trainval"})
    files.append_text(folder + part + ".txt", "");
  Capture capture;
  for (capture.index = 0; capture.index < dataset.capture_count; ++capture.index) {
    for (const std::string& camera : dataset.camera_names) {
      Frame frame;
      frame.camera_name = camera;
      const std::string line = training_.image_stem(capture, frame) + "\n";
      files.append_text(folder + training_.split(capture.index) + ".txt", line);
      files.append_text(folder + "trainval.txt", line);
    }
  }
}

bool VocWriter::is_difficult(const Instance& instance) const {
  const double visible =
      instance.visibility ? 1.0 - instance.visibility->occlusion().value_or(0.0) : 1.0;
  return visible < params_.difficult_below;
}

std::string VocWriter::occurrences(const std::vector<TrainingObject>& objects) const {
  std::string marks(training_.classes().size(), kAbsent);
  for (const TrainingObject& object : objects) {
    char& mark = marks[std::size_t(object.class_index)];
    if (!is_difficult(*object.instance)) mark = kShown;
    if (mark == kAbsent) mark = kDifficult;
  }
  return marks;
}

std::string VocWriter::object_xml(const Frame& frame, const TrainingObject& object) const {
  const Instance& instance = *object.instance;
  const PixelBox& box = *instance.tight_box;
  const double visible =
      instance.visibility ? 1.0 - instance.visibility->occlusion().value_or(0.0) : 1.0;
  const bool touches_edge = box.x_min == 0 || box.y_min == 0 || box.x_max == frame.camera.width ||
                            box.y_max == frame.camera.height;
  const bool is_truncated =
      instance.visibility ? instance.visibility->outside_pixels > 0 : touches_edge;
  return "  <object>\n    " +
         element("name", escaped(training_.classes()[std::size_t(object.class_index)])) + "\n    " +
         element("pose", "Unspecified") + "\n    " +
         element("truncated", is_truncated ? "1" : "0") + "\n    " +
         element("occluded", visible < 1.0 ? "1" : "0") + "\n    " +
         element("difficult", is_difficult(instance) ? "1" : "0") + "\n    <bndbox>" +
         element("xmin", std::to_string(box.x_min + 1)) +
         element("ymin", std::to_string(box.y_min + 1)) +
         element("xmax", std::to_string(box.x_max)) + element("ymax", std::to_string(box.y_max)) +
         "</bndbox>\n  </object>\n";
}

void VocWriter::write_segmentation(const Frame& frame, const std::vector<TrainingObject>& objects,
                                   const std::string& stem, CaptureFiles& files) const {
  if (objects.size() > 255) {
    throw Error(ErrorKind::Output, "SegmentationObject/" + stem +
                                       ".png: " + std::to_string(objects.size()) +
                                       " objects; 8-bit pictures have room for 255");
  }
  std::map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < objects.size(); ++i) place.emplace(objects[i].instance->id, i);
  const auto& ids = frame.get(kInstanceId);
  std::vector<std::uint8_t> classes(ids.pixels().size(), 0);
  std::vector<std::uint8_t> instances(ids.pixels().size(), 0);
  for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
    const auto found = place.find(ids.pixels()[i]);
    if (found == place.end()) continue;
    classes[i] = std::uint8_t(objects[found->second].class_index + 1);
    instances[i] = std::uint8_t(found->second + 1);
  }
  static const auto kPalette = voc_palette();
  files.add("SegmentationClass/" + stem + ".png",
            indexed_png_file(host_, ids.width(), ids.height(), classes, kPalette));
  files.add("SegmentationObject/" + stem + ".png",
            indexed_png_file(host_, ids.width(), ids.height(), instances, kPalette));
}

void VocWriter::write(const Capture& capture, CaptureFiles& files) const {
  std::string record;
  for (const Frame& frame : capture.frames) {
    const std::string stem = training_.image_stem(capture, frame);
    const std::string file = stem + "." + training_.image_format();
    files.add("JPEGImages/" + file, training_.image_file(host_, frame));
    const auto objects = training_.objects(frame);
    std::string xml = "<annotation>\n  " + element("folder", "JPEGImages") + "\n  " +
                      element("filename", escaped(file)) + "\n  <size>" +
                      element("width", std::to_string(frame.camera.width)) +
                      element("height", std::to_string(frame.camera.height)) +
                      element("depth", "3") + "</size>\n  " +
                      element("segmented", params_.segmentation ? "1" : "0") + "\n";
    for (const TrainingObject& object : objects) xml += object_xml(frame, object);
    files.add_text("Annotations/" + stem + ".xml", xml + "</annotation>\n");
    if (params_.segmentation) write_segmentation(frame, objects, stem, files);
    record += stem + " " + occurrences(objects) + " ";
  }
  files.record(record);
}

/// The records are pairs of a picture's name and its occurrences, spaces between them.
void VocWriter::finish(const RecordReader& records, DatasetFiles& files) {
  const std::vector<std::string> names = class_list_names(training_.classes());
  const auto list = [&names](std::size_t index, const char* part) {
    return "ImageSets/Main/" + names[index] + "_" + part + ".txt";
  };
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (const char* part : {"train", "val", "trainval"}) files.append_text(list(i, part), "");
  }
  records([&](int capture, std::string_view line) {
    const char* split = training_.split(capture);
    std::istringstream words{std::string(line)};
    for (std::string stem, marks; words >> stem >> marks;) {
      for (std::size_t i = 0; i < std::min(names.size(), marks.size()); ++i) {
        const std::string text = stem + list_mark(marks[i]);
        files.append_text(list(i, split), text);
        files.append_text(list(i, "trainval"), text);
      }
    }
  });
}

}  // namespace diorama
