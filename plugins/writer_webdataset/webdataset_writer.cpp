// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/webdataset_writer.h"

#include <map>
#include <span>
#include <string_view>
#include <vector>

#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/npy.h"
#include "writer_support/replicator.h"
#include "writer_webdataset/tar_archive.h"

namespace diorama {
namespace {

std::string shard_name(int capture, int count) {
  return "shards/" + padded(capture, grown_padding(6, count)) + ".tar";
}

Json object_json(const TrainingObject& object, const std::string& name) {
  const Instance& instance = *object.instance;
  const PixelBox& box = *instance.tight_box;
  Json json{{"class", name},
            {"class_index", object.class_index},
            {"node", instance.node_path},
            {"box", {box.x_min, box.y_min, box.x_max, box.y_max}},
            {"visible_px", object.visible_px},
            {"world_from_node", nested_list(instance.world_from_node.matrix())},
            {"bounds_min", flat_list(instance.bounds_node.min.transpose())},
            {"bounds_max", flat_list(instance.bounds_node.max.transpose())}};
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
  std::string train, val;
  for (int i = 0; i < dataset.capture_count; ++i) {
    (std::string_view(training_.split(i)) == "val" ? val : train) +=
        shard_name(i, dataset.capture_count) + "\n";
  }
  files.add_text("train.txt", train);
  files.add_text("val.txt", val);
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
  for (const TrainingObject& object : objects) {
    json["objects"].push_back(
        object_json(object, training_.classes()[std::size_t(object.class_index)]));
  }
  return json;
}

void WebDatasetWriter::write(const Capture& capture, CaptureFiles& files) const {
  TarArchive archive(files, shard_name(capture.index, training_.capture_count()));
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
  archive.end();
}

}  // namespace diorama
