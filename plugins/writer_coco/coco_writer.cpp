// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_writer.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <map>

#include "diorama/error.h"
#include "writer_support/cuboid.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/run_length.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

Json box_json(const PixelBox& box) { return {box.x_min, box.y_min, box.width(), box.height()}; }

/// Flat x, y, v: 0 not in the image, 1 hidden, 2 visible.
Json keypoints_json(const Frame& frame, const Instance& instance, int& count) {
  Json list = Json::array();
  for (const Keypoint& keypoint : kCuboidKeypoints) {
    const ImagePoint point = image_point(
        frame, instance.world_from_node * keypoint_in_box(instance.bounds_node, keypoint));
    if (point.state != ImagePoint::State::Outside) ++count;
    list.push_back(python_round(point.pixel.x(), 3));
    list.push_back(python_round(point.pixel.y(), 3));
    list.push_back(int(point.state));
  }
  return list;
}

/// Who is in front of it where both lie, and in how many pixels.
Json occluded_by_json(const Frame& frame, const Instance& instance) {
  Json list = Json::array();
  for (const Occlusion& occlusion : frame.occlusions) {
    if (occlusion.behind != instance.id) continue;
    const auto front = std::ranges::find(frame.instances, occlusion.front, &Instance::id);
    list.push_back({{"node", front->node_path}, {"pixels", occlusion.pixels}});
  }
  return list;
}

/// What is known of the whole object, hidden parts included.
Json amodal_json(const Frame& frame, const Instance& instance) {
  const Camera& camera = frame.camera;
  const Visibility& visibility = *instance.visibility;
  return {
      {"segmentation", coco_rle(run_length(visibility.amodal_mask, camera.width, camera.height))},
      {"bbox", box_json(*visibility.amodal_box)},
      {"area", visibility.amodal_pixels},
      {"occlusion", python_round(visibility.occlusion().value_or(0.0), 6)},
      {"truncation", python_round(visibility.truncation(), 6)},
      {"occluded_by", occluded_by_json(frame, instance)}};
}

Json image_json(const Capture& capture, const Frame& frame, int id, const std::string& file) {
  const Camera& camera = frame.camera;
  return {{"id", id},
          {"file_name", file},
          {"width", camera.width},
          {"height", camera.height},
          {"license", 0},
          {"capture", capture.index},
          {"camera", frame.camera_name},
          {"intrinsics", {camera.fx, camera.fy, camera.cx, camera.cy}},
          {"lens", lens_json(camera)},
          {"world_from_camera", nested_list(frame.world_from_camera.matrix())}};
}

Json dataset_json(const char* what, Json licenses, Json images, Json annotations, Json categories) {
  return {{"info", {{"description", what}, {"version", "1.0"}, {"contributor", "diorama"}}},
          {"licenses", std::move(licenses)},
          {"images", std::move(images)},
          {"annotations", std::move(annotations)},
          {"categories", std::move(categories)}};
}

/// Replicator's list of licences: id, name and url each.
Json licenses_json(const Value& value) {
  constexpr const char* kKey = "coco_license_info";
  Json list = Json::array();
  if (value.kind == Value::Kind::Null) return list;
  for (const Value& entry : value.list) {
    Json license = Json::object();
    for (const auto& [key, field] : entry.map) license[key] = field.scalar;
    if (license.contains("id")) license["id"] = std::atoi(entry.find("id")->scalar.c_str());
    list.push_back(std::move(license));
  }
  const bool is_good =
      value.kind == Value::Kind::List && std::ranges::all_of(value.list, [](const Value& entry) {
        return entry.kind == Value::Kind::Map && entry.find("id") && entry.find("name");
      });
  if (is_good) return list;
  throw Error(ErrorKind::Config, complaint_about(value, kKey) +
                                     "expected a list of {id, name, url} or null, found " +
                                     value.describe());
}

/// Where categories are given, their labels are the classes, in that order.
TrainingParams with_categories(TrainingParams params, const std::vector<CocoCategory>& categories,
                               const std::optional<std::string>& image_output_format) {
  if (!categories.empty()) params.classes.clear();
  for (const CocoCategory& category : categories) params.classes.push_back(category.label);
  if (!image_output_format) return params;
  params.image_format = *image_output_format == "jpeg" ? "jpg" : *image_output_format;
  const auto& known = kTrainingImageFormats;
  if (std::ranges::find(known, params.image_format) == std::end(known)) {
    throw Error(ErrorKind::Config, "image_output_format: expected png, jpg or jpeg, found \"" +
                                       *image_output_format + "\"");
  }
  return params;
}

void append(Json& list, Json& more) {
  for (Json& element : more) list.push_back(std::move(element));
}

}  // namespace

void CocoWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("keypoints", keypoints, {"Box centre and corners as keypoints."});
  v.param("amodal", amodal,
          {"Mask, box and area of the whole object, and who hides it, under \"amodal\"."});
  v.param("panoptic", panoptic, {"Panoptic pictures and annotations."});
  v.param("crowd_below_px", crowd_below_px,
          {"Objects with fewer visible pixels are marked iscrowd.", "px", 0.0});
  v.param(
      "coco_categories", coco_categories,
      {"Mapping of labels to {name, id, supercategory, color, isthing}; other labels become the "
       "category other. Null: classes count from 1."});
  v.param("coco_license_info", coco_license_info,
          {"List of {id, name, url} for the annotation files."});
  v.param("image_output_format", image_output_format, {"The same as image_format."});
  v.param("dataset_id", dataset_id, {"Accepted; names of files do not carry it."});
  v.param("frame_padding", frame_padding,
          {"Accepted; numbers have six digits or more.", "", 0, 20});
  labels.visit(v);
  remote.visit(v);
}

CocoWriter::CocoWriter(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      categories_(read_coco_categories(params_.coco_categories)),
      licenses_(licenses_json(params_.coco_license_info)),
      training_(with_categories(params_.training, categories_, params_.image_output_format),
                params_.labels.choice(params_.training.taxonomy),
                categories_.empty() ? "" : kOtherCategory) {
  params_.remote.check();
  if (!categories_.empty() && !params_.training.classes.empty()) {
    throw Error(ErrorKind::Config, "classes and coco_categories exclude each other");
  }
  const auto notice = [&](bool is_given, const char* text) {
    if (is_given) host_.log(LogLevel::Info, std::string("CocoWriter: ") + text);
  };
  notice(params_.dataset_id.has_value(),
         "dataset_id has no effect: names of files do not carry it");
  notice(params_.frame_padding.has_value(),
         "frame_padding has no effect: numbers have six digits or more");
}

NameSet CocoWriter::needs() const {
  NameSet names{std::string(kColor.name), std::string(kInstanceId.name), "instances"};
  if (params_.keypoints) names.emplace(kDistanceToCamera.name);
  if (params_.amodal) names.insert({"visibility", "amodal_mask", "occlusion_order"});
  return names;
}

int CocoWriter::category_id(int class_index) const {
  return categories_.empty() ? class_index + 1 : categories_[std::size_t(class_index)].id;
}

Json CocoWriter::categories() const {
  Json list = Json::array();
  for (std::size_t i = 0; i < training_.classes().size(); ++i) {
    CocoCategory own;
    own.id = int(i) + 1;
    own.name = training_.classes()[i];
    if (!categories_.empty()) own = categories_[i];
    Json category{{"id", own.id},
                  {"name", own.name},
                  {"supercategory", own.supercategory},
                  {"isthing", own.is_thing ? 1 : 0}};
    if (own.has_color) category["color"] = own.color;
    if (params_.keypoints) {
      for (const Keypoint& point : kCuboidKeypoints) category["keypoints"].push_back(point.name);
      category["skeleton"] = {{2, 3}, {3, 5}, {5, 4}, {4, 2}, {6, 7}, {7, 9},
                              {9, 8}, {8, 6}, {2, 6}, {3, 7}, {4, 8}, {5, 9}};
    }
    list.push_back(std::move(category));
  }
  return list;
}

void CocoWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  files.add_text("categories.json", python_json(categories(), 2) + "\n");
  training_.add_dataset_page(
      "COCO",
      {{"bbox", "x, y, width, height in pixels, of the visible pixels"},
       {"segmentation", "compressed run lengths of the visible pixels, column by column"},
       {"amodal.occluded_by",
        "objects nearer to the camera in pixels that both cover, seen or not, and how many pixels"},
       {"keypoint_visibility", "0 outside the image, 1 hidden, 2 visible"}},
      dataset, files);
}

Json CocoWriter::annotation(const Frame& frame, const TrainingObject& object, int image_id) const {
  const Instance& instance = *object.instance;
  Json json{{"image_id", image_id},
            {"category_id", category_id(object.class_index)},
            {"iscrowd", object.visible_px < params_.crowd_below_px ? 1 : 0},
            {"bbox", box_json(*instance.tight_box)},
            {"area", object.visible_px},
            {"segmentation",
             coco_rle(run_length(frame.get(kInstanceId), instance.id, *instance.tight_box))},
            {"node", instance.node_path}};
  if (params_.keypoints) {
    int count = 0;
    json["keypoints"] = keypoints_json(frame, instance, count);
    json["num_keypoints"] = count;
  }
  if (params_.amodal && instance.visibility && instance.visibility->amodal_box) {
    json["amodal"] = amodal_json(frame, instance);
  }
  return json;
}

Json CocoWriter::panoptic_annotation(const Frame& frame, const std::vector<TrainingObject>& objects,
                                     int image_id, const std::string& stem, const char* split,
                                     CaptureFiles& files) const {
  std::map<std::uint32_t, std::uint32_t> segment_of_id;
  Json segments = Json::array();
  for (const TrainingObject& object : objects) {
    const auto segment = std::uint32_t(segment_of_id.size() + 1);
    segment_of_id.emplace(object.instance->id, segment);
    segments.push_back({{"id", segment},
                        {"category_id", category_id(object.class_index)},
                        {"area", object.visible_px},
                        {"bbox", box_json(*object.instance->tight_box)},
                        {"iscrowd", 0}});
  }
  const auto& ids = frame.get(kInstanceId);
  Image<Rgba8> picture(ids.width(), ids.height(), {0, 0, 0, 255});
  for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
    const auto found = segment_of_id.find(ids.pixels()[i]);
    if (found == segment_of_id.end()) continue;
    // id = red + 256 green + 65536 blue.
    for (std::size_t c = 0; c < 3; ++c) {
      picture.pixels()[i][c] = std::uint8_t(found->second >> (8 * c));
    }
  }
  files.add(std::string("panoptic/") + split + "/" + stem + ".png", rgb_png_file(host_, picture));
  return {{"image_id", image_id}, {"file_name", stem + ".png"}, {"segments_info", segments}};
}

void CocoWriter::write(const Capture& capture, CaptureFiles& files) const {
  const char* split = training_.split(capture.index);
  Json record{{"split", split},
              {"images", Json::array()},
              {"annotations", Json::array()},
              {"panoptic", Json::array()}};
  for (std::size_t camera = 0; camera < capture.frames.size(); ++camera) {
    const Frame& frame = capture.frames[camera];
    const int id = capture.index * int(capture.frames.size()) + int(camera) + 1;
    const std::string stem = training_.image_stem(capture, frame);
    const std::string file = stem + "." + training_.image_format();
    files.add(std::string("images/") + split + "/" + file, training_.image_file(host_, frame));
    record["images"].push_back(image_json(capture, frame, id, file));
    const auto objects = training_.objects(frame);
    for (const TrainingObject& object : objects) {
      record["annotations"].push_back(annotation(frame, object, id));
    }
    if (params_.panoptic) {
      record["panoptic"].push_back(panoptic_annotation(frame, objects, id, stem, split, files));
    }
  }
  files.record(python_json(record));
}

void CocoWriter::finish(const RecordReader& records, DatasetFiles& files) {
  struct Part {
    Json images = Json::array();
    Json annotations = Json::array();
    Json panoptic = Json::array();
  };
  std::map<std::string, Part> parts;
  for (const std::string& split : training_.splits()) parts[split];
  records([&parts](int, std::string_view line) {
    Json record = Json::parse(line);
    Part& part = parts[record.at("split")];
    append(part.images, record.at("images"));
    for (Json& annotation : record.at("annotations")) {
      Json numbered{{"id", part.annotations.size() + 1}};
      numbered.update(annotation);
      part.annotations.push_back(std::move(numbered));
    }
    append(part.panoptic, record.at("panoptic"));
  });
  for (auto& [split, part] : parts) {
    if (params_.panoptic) {
      files.add_text("annotations/panoptic_" + split + ".json",
                     python_json(dataset_json("Panoptic segmentation", licenses_, part.images,
                                              std::move(part.panoptic), categories())));
    }
    files.add_text("annotations/instances_" + split + ".json",
                   python_json(dataset_json("Instances", licenses_, std::move(part.images),
                                            std::move(part.annotations), categories())));
  }
}

}  // namespace diorama
