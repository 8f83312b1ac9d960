// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_writer.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <map>
#include <set>
#include <system_error>

#include "diorama/error.h"
#include "opencv_support/contours.h"
#include "writer_support/clips_json.h"
#include "writer_support/cuboid.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/run_length.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

constexpr const char* kSegmentations[] = {"rle", "polygon"};

Json box_json(const PixelBox& box) { return {box.x_min, box.y_min, box.width(), box.height()}; }

/// Flat x, y, v: 0 not in the image, 1 hidden, 2 visible. Of the named ones, if there are any, or
/// of the box.
Json keypoints_json(const Frame& frame, const Instance& instance,
                    const std::vector<std::string>& names, int& count) {
  Json list = Json::array();
  const auto add = [&](const ImagePoint& point) {
    if (point.state != ImagePoint::State::Outside) ++count;
    list.push_back(python_round(point.pixel.x(), 3));
    list.push_back(python_round(point.pixel.y(), 3));
    list.push_back(int(point.state));
  };
  for (const std::string& name : names) add(named_point(frame, instance, name));
  if (!names.empty()) return list;
  for (const CuboidPoint& keypoint : kCuboidKeypoints) {
    add(image_point(frame,
                    instance.world_from_node * keypoint_in_box(instance.bounds_node, keypoint)));
  }
  return list;
}

/// In the dataset that it comes from, as its reader labels it.
bool was_crowd(const Instance& instance) {
  const auto label = instance.labels.find(kCrowdLabel);
  return label != instance.labels.end() && label->second == "1";
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

/// A flat list x, y, x, y ... per part.
Json polygons_json(const Image<std::uint32_t>& ids, const Instance& instance) {
  Json list = Json::array();
  for (const Outline& part : outlines(ids, instance.id, *instance.tight_box)) {
    Json polygon = Json::array();
    for (const Vec2& corner : joined(part)) {
      polygon.push_back(int(corner.x()));
      polygon.push_back(int(corner.y()));
    }
    list.push_back(std::move(polygon));
  }
  return list;
}

/// Each camera of a clip is a video; they count from 1.
int video_id(const Capture& capture, std::size_t camera) {
  return capture.clip->clip * int(capture.frames.size()) + int(camera) + 1;
}

Json rle_json(const Frame& frame, const Instance& instance) {
  return coco_rle(run_length(frame.get(kInstanceId), instance.id, *instance.tight_box));
}

/// Tools for videos take the runs as numbers only.
Json runs_json(const Frame& frame, const Instance& instance) {
  const RunLength runs = run_length(frame.get(kInstanceId), instance.id, *instance.tight_box);
  return {{"size", {runs.height, runs.width}}, {"counts", runs.counts}};
}

Json image_json(const Capture& capture, std::size_t camera_index, int id, const std::string& file,
                const Json& licenses) {
  const Frame& frame = capture.frames[camera_index];
  const Camera& camera = frame.camera;
  Json json{{"id", id},
            {"file_name", file},
            {"width", camera.width},
            {"height", camera.height},
            {"license", licenses.at(0).at("id")},
            {"capture", capture.index},
            {"camera", frame.camera_name},
            {"intrinsics", intrinsics_json(camera)},
            {"lens", lens_json(camera)},
            {"world_from_camera", nested_list(frame.world_from_camera.matrix())}};
  if (capture.clip) {
    json["video_id"] = video_id(capture, camera_index);
    add_clip_frame(capture, json);
  }
  return json;
}

// A record is the split's name and the JSON texts that the capture adds to the annotation files,
// each behind a tab and the letter of its list: no JSON text holds a tab. So finish() need not
// parse them.
constexpr char kImageRecord = 'i';
constexpr char kAnnotationRecord = 'a';
constexpr char kPanopticRecord = 'p';
constexpr char kVideoRecord = 'v';

void add_to(std::string& record, char kind, const std::string& text) {
  record += '\t';
  record += kind;
  record += text;
}

/// `visit(split, kind, text)` for every text of every record.
template <class Visit>
void for_each_part(const RecordReader& records, const Visit& visit) {
  records([&visit](int, std::string_view line) {
    const std::string split(line.substr(0, line.find('\t')));
    for (std::size_t at = line.find('\t'); at != std::string_view::npos;) {
      const std::size_t end = line.find('\t', at + 1);
      visit(split, line.at(at + 1), line.substr(at + 2, end - at - 2));
      at = end;
    }
  });
}

/// One of the files below annotations/, which grows from its beginning to its end.
class AnnotationFile {
 public:
  AnnotationFile(DatasetFiles& files, std::string path, const char* what, const Json& licenses,
                 const char* list = "images")
      : files_(files), path_(std::move(path)) {
    const Json info{{"description", what}, {"version", "1.0"}, {"contributor", "diorama"}};
    put("{\"info\": " + python_json(info) + ", \"licenses\": " + python_json(licenses) + ", \"" +
        list + "\": [");
  }
  /// The next element of the list.
  void add(std::string_view text) {
    if (count_++ > 0) put(", ");
    put(text);
  }
  /// The same with its number as its id.
  void add_numbered(std::string_view object) {
    if (count_++ > 0) put(", ");
    put("{\"id\": " + std::to_string(count_) + ", ");
    put(object.substr(1));
  }
  void begin_annotations() {
    put("], \"annotations\": [");
    count_ = 0;
  }
  void end(const Json& categories) { put("], \"categories\": " + python_json(categories) + "}"); }

 private:
  void put(std::string_view text) { files_.append_text(path_, text); }

  DatasetFiles& files_;
  std::string path_;
  std::size_t count_ = 0;
};

/// Replicator's list of licences: id, name and url each. Without one, that nothing is said.
Json licenses_json(const Value& value) {
  constexpr const char* kLicensesKey = "coco_license_info";
  const bool is_empty = value.kind == Value::Kind::List && value.list.empty();
  if (value.kind == Value::Kind::Null || is_empty) {
    return Json::array({{{"id", 1}, {"name", "unspecified"}, {"url", ""}}});
  }
  const auto complain = [&](const Value& at, const std::string& what) {
    throw Error(ErrorKind::Config, complaint_about(at, kLicensesKey) + what);
  };
  if (value.kind != Value::Kind::List) {
    complain(value, "expected a list of {id, name, url} or null, found " + value.describe());
  }
  Json list = Json::array();
  std::set<int> ids;
  for (const Value& entry : value.list) {
    const Value* id = entry.kind == Value::Kind::Map ? entry.find("id") : nullptr;
    if (!id || !entry.find("name")) {
      complain(entry, "expected {id, name, url}, found " + entry.describe());
    }
    int number = 0;
    const char* end = id->scalar.data() + id->scalar.size();
    const auto read = std::from_chars(id->scalar.data(), end, number);
    if (read.ec != std::errc() || read.ptr != end) {
      complain(*id, "expected a whole number as the id of a licence, found " + id->describe());
    }
    if (!ids.insert(number).second) complain(*id, "two licences have this id");
    Json license = Json::object();
    for (const auto& [key, field] : entry.map) license[key] = field.scalar;
    license["id"] = number;
    list.push_back(std::move(license));
  }
  return list;
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
    throw Error(ErrorKind::Config, "image_output_format: expected png, jpg or jpeg, found '" +
                                       *image_output_format + "'");
  }
  return params;
}

}  // namespace

void CocoWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  training.visit_masks(v);
  v.param("keypoints", keypoints,
          {"Keypoints: those that the job names for the objects of a class, else box centre and "
           "corners."});
  v.param("amodal", amodal,
          {"Mask, box and area of the whole object, and who hides it, under \"amodal\"."});
  v.param("panoptic", panoptic, {"Panoptic pictures and annotations."});
  v.param("youtube_vis", youtube_vis,
          {"Of clips also youtube_vis/{train,val}.json: videos and tracks with a mask per "
           "frame, as YouTube-VIS has them."});
  v.choice("segmentation", segmentation, kSegmentations,
           {"Masks as compressed run lengths, exact, or as polygons along pixel edges."});
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
  if (!params_.training.masks) {
    if (params_.youtube_vis) {
      throw Error(ErrorKind::Config, "youtube_vis has masks; 'masks: false' excludes it");
    }
    params_.amodal = params_.panoptic = false;
  }
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
  NameSet names{std::string(kColor.name), "instances"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
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
      if (const auto& names = keypoints_.of_class(int(i)); !names.empty()) {
        category["keypoints"] = names;
        category["skeleton"] = Json::array();
      } else {
        for (const CuboidPoint& point : kCuboidKeypoints) {
          category["keypoints"].push_back(point.name);
        }
        category["skeleton"] = {{2, 3}, {3, 5}, {5, 4}, {4, 2}, {6, 7}, {7, 9},
                                {9, 8}, {8, 6}, {2, 6}, {3, 7}, {4, 8}, {5, 9}};
      }
    }
    list.push_back(std::move(category));
  }
  return list;
}

void CocoWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  has_clips_ = !dataset.clips.empty();
  training_.begin(dataset);
  keypoints_.begin(dataset, training_);
  files.add_text("categories.json", python_json(categories(), 2) + "\n");
  nlohmann::ordered_json conventions{
      {"bbox", "x, y, width, height in pixels, of the visible pixels"},
      {"segmentation", "compressed run lengths of the visible pixels, column by column"},
      {"amodal.occluded_by",
       "objects nearer to the camera in pixels that both cover, seen or not, and how many pixels"},
      {"keypoint_visibility", "0 outside the image, 1 hidden, 2 visible"}};
  if (!params_.training.masks) {
    conventions.erase("segmentation");
    conventions["area"] = "of the box";
  }
  if (params_.crowd_below_px > 0) conventions["crowd_below_px"] = params_.crowd_below_px;
  training_.add_dataset_page("COCO", std::move(conventions), dataset, files);
}

/// Crowds are run lengths in any case, as evaluations expect them.
Json CocoWriter::segmentation_json(const Frame& frame, const Instance& instance,
                                   bool is_crowd) const {
  if (params_.segmentation == "polygon" && !is_crowd) {
    return polygons_json(frame.get(kInstanceId), instance);
  }
  return rle_json(frame, instance);
}

Json CocoWriter::annotation(const Frame& frame, const TrainingObject& object, int image_id) const {
  const Instance& instance = *object.instance;
  const bool is_crowd = object.visible_px < params_.crowd_below_px || was_crowd(instance);
  Json json{{"image_id", image_id},
            {"category_id", category_id(object.class_index)},
            {"iscrowd", is_crowd ? 1 : 0},
            {"bbox", box_json(*instance.tight_box)},
            {"area", object.visible_px}};
  if (params_.training.masks) {
    json["segmentation"] = segmentation_json(frame, instance, is_crowd);
  }
  json["node"] = instance.node_path;
  if (params_.keypoints) {
    int count = 0;
    json["keypoints"] =
        keypoints_json(frame, instance, keypoints_.of_class(object.class_index), count);
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
                        {"iscrowd", was_crowd(*object.instance) ? 1 : 0}});
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
  std::string record = split;
  for (std::size_t camera = 0; camera < capture.frames.size(); ++camera) {
    const Frame& frame = capture.frames[camera];
    const int id = capture.index * int(capture.frames.size()) + int(camera) + 1;
    const std::string stem = training_.image_stem(capture, frame);
    const std::string file = stem + "." + training_.image_format();
    files.add(std::string("images/") + split + "/" + file, training_.image_file(host_, frame));
    add_to(record, kImageRecord, python_json(image_json(capture, camera, id, file, licenses_)));
    const auto objects = training_.objects(frame);
    for (const TrainingObject& object : objects) {
      Json json = annotation(frame, object, id);
      if (capture.clip) json["track_id"] = object.instance->id;
      add_to(record, kAnnotationRecord, python_json(json));
    }
    if (capture.clip && params_.youtube_vis) {
      add_to(record, kVideoRecord, python_json(video_frame(capture, camera, file, objects)));
    }
    if (params_.panoptic) {
      add_to(record, kPanopticRecord,
             python_json(panoptic_annotation(frame, objects, id, stem, split, files)));
    }
  }
  files.record(record);
}

/// What YouTube-VIS needs of one picture: masks are those of the annotations, always as run
/// lengths, and not packed.
Json CocoWriter::video_frame(const Capture& capture, std::size_t camera, const std::string& file,
                             const std::vector<TrainingObject>& objects) const {
  const Frame& frame = capture.frames[camera];
  Json json{{"video", video_id(capture, camera)}, {"file", file},
            {"width", frame.camera.width},        {"height", frame.camera.height},
            {"frame", capture.clip->frame},       {"length", capture.clip->frame_count},
            {"fps", capture.clip->fps},           {"objects", Json::array()}};
  for (const TrainingObject& object : objects) {
    json["objects"].push_back({{"track", object.instance->id},
                               {"category_id", category_id(object.class_index)},
                               {"segmentation", runs_json(frame, *object.instance)},
                               {"bbox", box_json(*object.instance->tight_box)},
                               {"area", object.visible_px}});
  }
  return json;
}

/// Tracks of one clip are in memory at a time.
void CocoWriter::write_videos(const RecordReader& records, DatasetFiles& files) {
  std::map<std::string, AnnotationFile> lists;
  for (const std::string& split : training_.splits()) {
    const std::string path = "youtube_vis/" + split + ".json";
    lists.emplace(split, AnnotationFile(files, path, "Video instances", licenses_, "videos"));
  }
  const auto for_each_video_frame = [&](const auto& visit) {
    for_each_part(records, [&](const std::string& split, char kind, std::string_view text) {
      if (kind == kVideoRecord) visit(split, Json::parse(text));
    });
  };
  std::map<int, Json> open;  // by video
  for_each_video_frame([&](const std::string& split, const Json& frame) {
    const int video = frame.at("video").get<int>();
    Json& entry = open[video];
    if (entry.is_null()) {
      entry = {{"id", video},
               {"width", frame.at("width")},
               {"height", frame.at("height")},
               {"length", frame.at("length")},
               {"fps", frame.at("fps")},
               {"file_names", Json::array()}};
    }
    entry["file_names"].push_back(frame.at("file"));
    if (entry["file_names"].size() < frame.at("length").get<std::size_t>()) return;
    lists.at(split).add(python_json(entry));
    open.erase(video);
  });
  for (auto& [split, list] : lists) list.begin_annotations();
  std::map<int, std::map<std::uint32_t, Json>> tracks;  // by video
  for_each_video_frame([&](const std::string& split, const Json& frame) {
    const int video = frame.at("video").get<int>();
    const auto length = frame.at("length").get<std::size_t>();
    for (const Json& object : frame.at("objects")) {
      Json& track = tracks[video][object.at("track").get<std::uint32_t>()];
      if (track.is_null()) {
        const Json nothing(std::vector<Json>(length, nullptr));
        track = {{"video_id", video},
                 {"track_id", object.at("track")},
                 {"category_id", object.at("category_id")},
                 {"iscrowd", 0},
                 {"width", frame.at("width")},
                 {"height", frame.at("height")},
                 {"length", 1},
                 {"segmentations", nothing},
                 {"bboxes", nothing},
                 {"areas", nothing}};
      }
      const auto at = frame.at("frame").get<std::size_t>();
      track["segmentations"][at] = object.at("segmentation");
      track["bboxes"][at] = object.at("bbox");
      track["areas"][at] = object.at("area");
    }
    if (frame.at("frame").get<std::size_t>() + 1 < length) return;
    for (const auto& [id, track] : tracks[video]) lists.at(split).add_numbered(python_json(track));
    tracks.erase(video);
  });
  for (auto& [split, list] : lists) list.end(categories());
}

void CocoWriter::finish(const RecordReader& records, DatasetFiles& files) {
  if (params_.youtube_vis && has_clips_) write_videos(records, files);
  std::map<std::string, AnnotationFile> instances, panoptic;
  for (const std::string& split : training_.splits()) {
    const auto begin = [&](const char* kind, const char* what, auto& all) {
      const std::string path = std::string("annotations/") + kind + "_" + split + ".json";
      all.emplace(split, AnnotationFile(files, path, what, licenses_));
    };
    begin("instances", "Instances", instances);
    if (params_.panoptic) begin("panoptic", "Panoptic segmentation", panoptic);
  }
  // Pictures come before annotations, so the records are read twice: little of them is in memory.
  for_each_part(records, [&](const std::string& split, char kind, std::string_view text) {
    if (kind != kImageRecord) return;
    instances.at(split).add(text);
    if (params_.panoptic) panoptic.at(split).add(text);
  });
  for (auto* all : {&instances, &panoptic}) {
    for (auto& [split, file] : *all) file.begin_annotations();
  }
  for_each_part(records, [&](const std::string& split, char kind, std::string_view text) {
    if (kind == kAnnotationRecord) instances.at(split).add_numbered(text);
    if (kind == kPanopticRecord) panoptic.at(split).add(text);
  });
  for (auto* all : {&instances, &panoptic}) {
    for (auto& [split, file] : *all) file.end(categories());
  }
}

}  // namespace diorama
