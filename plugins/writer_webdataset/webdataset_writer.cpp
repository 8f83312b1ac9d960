// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/webdataset_writer.h"

#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/error.h"
#include "writer_support/clips_json.h"
#include "writer_support/cuboid.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/npy.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

/// There are at most as many shards as captures.
std::string shard_name(const std::string& front, int number, int captures) {
  return "shards/" + front + padded(number, grown_padding(6, captures)) + ".tar";
}

std::uint64_t bytes_of_record(int capture, std::string_view line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object() || !json.contains("bytes") || !json["bytes"].is_number_unsigned()) {
    throw Error(ErrorKind::Output, "capture " + std::to_string(capture) +
                                       ": expected a record with 'bytes', found '" +
                                       std::string(line) + "'");
  }
  return json["bytes"].get<std::uint64_t>();
}

/// The shards of one part of a dataset, filled one after the other.
class ShardFiller {
 public:
  ShardFiller(DatasetFiles& files, std::string split, int captures)
      : files_(files), split_(std::move(split)), captures_(captures) {}

  /// Into the shard at hand, or the next one where that would get too large.
  void add(int capture, std::uint64_t bytes, int most_captures, double most_bytes) {
    constexpr double kEnd = 1024;
    const bool is_full = held_ >= most_captures || double(bytes_ + bytes) + kEnd > most_bytes;
    if (held_ > 0 && is_full) end_shard();
    if (held_ == 0) files_.append_text(split_ + ".txt", name() + "\n");
    files_.append_kept(name(), capture);
    ++held_;
    bytes_ += bytes;
  }
  void end() {
    if (held_ > 0) end_shard();
    files_.append_text(split_ + ".txt", "");
  }

 private:
  std::string name() const { return shard_name(split_ + "-", number_, captures_); }
  void end_shard() {
    TarArchive([this](std::span<const std::byte> bytes) { files_.append(name(), bytes); }).end();
    ++number_;
    held_ = 0;
    bytes_ = 0;
  }

  DatasetFiles& files_;
  std::string split_;
  int captures_;
  int number_ = 0;
  int held_ = 0;
  std::uint64_t bytes_ = 0;
};

Json object_json(const TrainingObject& object, const std::string& name) {
  const Instance& instance = *object.instance;
  const PixelBox& box = *instance.tight_box;
  Json json{{"class", name},
            {"class_index", object.class_index},
            {"node", instance.node_path},
            {"box", {box.x_min, box.y_min, box.x_max, box.y_max}},
            {"visible_px", object.visible_px}};
  add_pose(instance, json);
  if (instance.visibility) {
    json["visible_share"] = 1.0 - instance.visibility->occlusion().value_or(0.0);
    json["truncation"] = instance.visibility->truncation();
  }
  return json;
}

Image<std::uint32_t> instance_picture(const Frame& frame,
                                      const std::vector<TrainingObject>& objects) {
  std::map<std::uint32_t, std::uint32_t> place;
  for (const TrainingObject& object : objects) {
    place.emplace(object.instance->id, std::uint32_t(place.size() + 1));
  }
  Image<std::uint32_t> picture = frame.get(kInstanceId);
  for (std::uint32_t& pixel : picture.pixels()) {
    const auto found = place.find(pixel);
    pixel = found == place.end() ? 0 : found->second;
  }
  return picture;
}

}  // namespace

void WebDatasetWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("depth", depth, {"A depth array per sample."});
  v.param("instances", instances, {"A picture of object numbers per sample."});
  v.param("shard_captures", shard_captures,
          {"Most captures in a shard; 0: as many as shard_size_mb allows, or one without it.", "",
           0.0});
  v.param("shard_size_mb", shard_size_mb,
          {"Most megabytes (10^6 bytes) in a shard of several captures; 0: any.", "MB", 0.0, 1e9});
  channels.visit(v);
}

WebDatasetWriter::WebDatasetWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {
  constexpr std::string_view kTaken[] = {"depth", "instances"};
  params_.channels.check(kTaken);
}

NameSet WebDatasetWriter::needs() const {
  NameSet names{std::string(kColor.name), std::string(kInstanceId.name), "instances", "visibility"};
  if (params_.depth) names.emplace(kDistanceToImagePlane.name);
  params_.channels.add_to(names);
  return names;
}

void WebDatasetWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  if (!fills_shards()) {
    for (const char* file : {"train.txt", "val.txt"}) files.append_text(file, "");
    for (int i = 0; i < dataset.capture_count; ++i) {
      files.append_text(std::string(training_.split(i)) + ".txt",
                        shard_name("", i, dataset.capture_count) + "\n");
    }
  }
  training_.add_dataset_page(
      "WebDataset",
      {{"matrices", "four rows of four, column vectors: point_a = a_from_b * point_b"},
       {"depth", "float32 metres along the viewing axis, infinity: nothing"},
       {"instances", "16 bit, the object's place in the list + 1, 0: none"}},
      dataset, files);
}

Json WebDatasetWriter::sample_json(const Capture& capture, const Frame& frame,
                                   const std::vector<TrainingObject>& objects) const {
  const Camera& camera = frame.camera;
  Json json{{"capture", capture.index},
            {"phase", capture.phase},
            {"camera", frame.camera_name},
            {"width", camera.width},
            {"height", camera.height},
            {"intrinsics", intrinsics_json(camera)},
            {"lens", lens_json(camera)},
            {"world_from_camera", nested_list(frame.world_from_camera.matrix())},
            {"objects", Json::array()}};
  add_clip_frame(capture, json);
  for (const TrainingObject& object : objects) {
    json["objects"].push_back(
        object_json(object, training_.classes()[std::size_t(object.class_index)]));
  }
  return json;
}

void WebDatasetWriter::write(const Capture& capture, CaptureFiles& files) const {
  if (fills_shards()) {
    TarArchive archive([&](std::span<const std::byte> bytes) { files.keep(bytes); });
    add_samples(capture, archive);
    files.record(Json{{"bytes", archive.bytes()}}.dump());
    return;
  }
  const std::string shard = shard_name("", capture.index, training_.capture_count());
  TarArchive archive([&](std::span<const std::byte> bytes) { files.append(shard, bytes); });
  add_samples(capture, archive);
  archive.end();
}

void WebDatasetWriter::finish(const RecordReader& records, DatasetFiles& files) {
  if (!fills_shards()) return;
  constexpr int kAnyCount = std::numeric_limits<int>::max();
  constexpr double kAnySize = std::numeric_limits<double>::infinity();
  const int most_captures = params_.shard_captures > 0 ? params_.shard_captures : kAnyCount;
  const double most_bytes = params_.shard_size_mb > 0.0 ? params_.shard_size_mb * 1e6 : kAnySize;
  ShardFiller train(files, "train", training_.capture_count());
  ShardFiller val(files, "val", training_.capture_count());
  records([&](int capture, std::string_view line) {
    ShardFiller& part = std::string_view(training_.split(capture)) == "val" ? val : train;
    part.add(capture, bytes_of_record(capture, line), most_captures, most_bytes);
  });
  train.end();
  val.end();
}

void WebDatasetWriter::add_samples(const Capture& capture, TarArchive& archive) const {
  for (const Frame& frame : capture.frames) {
    const std::string key = training_.image_stem(capture, frame);
    const auto objects = training_.objects(frame);
    const auto add_array = [&](const std::string& ending, std::string_view channel) {
      const ImageNumbers numbers = numbers_of(frame.image_named(channel));
      const std::vector<std::byte> header = npy_header(numbers.descr, numbers.shape);
      const std::span<const std::byte> parts[] = {header, numbers.bytes};
      archive.add(key + "." + ending + ".npy", parts);
    };
    archive.add(key + "." + training_.image_format(), training_.image_file(host_, frame));
    archive.add(key + ".json", python_json(sample_json(capture, frame, objects)));
    if (params_.instances) {
      archive.add(key + ".instances.png", png_file(host_, instance_picture(frame, objects), key));
    }
    if (params_.depth) add_array("depth", kDistanceToImagePlane.name);
    for (const std::string& channel : params_.channels.names) add_array(channel, channel);
  }
}

}  // namespace diorama
