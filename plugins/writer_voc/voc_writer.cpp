// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/voc_writer.h"

#include <algorithm>
#include <map>

#include "writer_support/image_files.h"
#include "writer_support/replicator.h"

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

std::string element(const char* name, const std::string& text) {
  return "<" + std::string(name) + ">" + text + "</" + name + ">";
}

}  // namespace

void VocWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("segmentation", segmentation, {"Class and object pictures."});
  v.param("difficult_below", difficult_below,
          {"Objects with a smaller visible share are marked difficult.", "", 0.0, 1.0});
}

VocWriter::VocWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {}

NameSet VocWriter::needs() const {
  return {std::string(kColor.name), std::string(kInstanceId.name), "instances", "visibility"};
}

void VocWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  if (params_.segmentation && training_.classes().size() > 255) {
    throw Error(ErrorKind::Config, "segmentation: " + std::to_string(training_.classes().size()) +
                                       " classes; 8-bit pictures have room for 255");
  }
  std::string labels, train, val, both;
  for (const std::string& name : training_.classes()) labels += name + "\n";
  for (int i = 0; i < dataset.capture_count; ++i) {
    Capture capture;
    capture.index = i;
    for (const std::string& camera : dataset.camera_names) {
      Frame frame;
      frame.camera_name = camera;
      const std::string line = training_.image_stem(capture, frame) + "\n";
      (std::string_view(training_.split(i)) == "val" ? val : train) += line;
      both += line;
    }
  }
  files.add_text("labels.txt", labels);
  for (const char* kind : {"Main", "Segmentation"}) {
    if (!params_.segmentation && std::string_view(kind) == "Segmentation") continue;
    files.add_text(std::string("ImageSets/") + kind + "/train.txt", train);
    files.add_text(std::string("ImageSets/") + kind + "/val.txt", val);
    files.add_text(std::string("ImageSets/") + kind + "/trainval.txt", both);
  }
  training_.add_dataset_page(
      "Pascal VOC",
      {{"boxes", "pixels counted from 1, the last one included"},
       {"segmentation", "8-bit gray: class index + 1 or object's place + 1, 0 is background"}},
      dataset, files);
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
         element("difficult", visible < params_.difficult_below ? "1" : "0") + "\n    <bndbox>" +
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
  files.add("SegmentationClass/" + stem + ".png",
            png_file(host_, ids.width(), ids.height(), classes));
  files.add("SegmentationObject/" + stem + ".png",
            png_file(host_, ids.width(), ids.height(), instances));
}

void VocWriter::write(const Capture& capture, CaptureFiles& files) const {
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
  }
}

}  // namespace diorama
