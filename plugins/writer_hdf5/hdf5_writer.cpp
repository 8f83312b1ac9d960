// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_writer.h"

#include <array>
#include <map>
#include <mutex>

#include "writer_hdf5/hdf5_file.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"

namespace diorama {
namespace {

/// One for the process, because the library's state is.
std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

struct Segmentation {
  std::vector<std::uint16_t> instances;
  std::vector<std::uint16_t> categories;
};

Segmentation segmentation_of(const Frame& frame, const std::vector<TrainingObject>& objects) {
  std::map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < objects.size(); ++i) place.emplace(objects[i].instance->id, i);
  const auto ids = frame.get(kInstanceId).pixels();
  Segmentation maps{std::vector<std::uint16_t>(ids.size(), 0),
                    std::vector<std::uint16_t>(ids.size(), 0)};
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto found = place.find(ids[i]);
    if (found == place.end()) continue;
    maps.instances[i] = std::uint16_t(found->second + 1);
    maps.categories[i] = std::uint16_t(objects[found->second].class_index + 1);
  }
  return maps;
}

std::vector<float> mapped_normals(const Image<Vec3f>& normals) {
  std::vector<float> values;
  values.reserve(normals.pixels().size() * 3);
  for (const Vec3f& normal : normals.pixels()) {
    for (int axis = 0; axis < 3; ++axis) values.push_back(0.5f * (normal[axis] + 1.0f));
  }
  return values;
}

Json attributes_json(const std::vector<TrainingObject>& objects,
                     const std::vector<std::string>& classes) {
  Json list = Json::array();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const Instance& instance = *objects[i].instance;
    list.push_back({{"idx", i + 1},
                    {"name", instance.node_path},
                    {"category_id", objects[i].class_index + 1},
                    {"class", classes[std::size_t(objects[i].class_index)]},
                    {"world_from_node", nested_list(instance.world_from_node.matrix())},
                    {"bounds_min", flat_list(instance.bounds_node.min.transpose())},
                    {"bounds_max", flat_list(instance.bounds_node.max.transpose())}});
  }
  return list;
}

}  // namespace

void Hdf5Writer::Params::visit(ParamVisitor& v) {
  training.visit(v);
  v.param("depth", depth, {"Depth along the viewing axis."});
  v.param("normals", normals, {"World normals."});
  channels.visit(v);
}

Hdf5Writer::Hdf5Writer(Params params, Host&)
    : params_(std::move(params)), training_(params_.training) {
  constexpr std::string_view kTaken[] = {"colors",
                                         "depth",
                                         "normals",
                                         "instance_segmaps",
                                         "category_id_segmaps",
                                         "cam_K",
                                         "world_from_camera",
                                         "lens",
                                         "instance_attribute_maps"};
  params_.channels.check(kTaken);
}

NameSet Hdf5Writer::needs() const {
  NameSet names{std::string(kColor.name), std::string(kInstanceId.name), "instances"};
  if (params_.depth) names.emplace(kDistanceToImagePlane.name);
  if (params_.normals) names.emplace(kNormals.name);
  params_.channels.add_to(names);
  return names;
}

void Hdf5Writer::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  training_.add_dataset_page(
      "HDF5",
      {{"matrices", "column vectors: point_a = a_from_b * point_b"},
       {"depth", "float32 metres along the viewing axis, infinity: nothing"},
       {"normals", "world space, (n + 1) / 2"},
       {"segmaps", "instance: place in instance_attribute_maps + 1; category: class index + 1"}},
      dataset, files);
}

std::vector<std::byte> Hdf5Writer::frame_file(const Frame& frame) const {
  const Camera& camera = frame.camera;
  const auto objects = training_.objects(frame);
  const Segmentation segmentation = segmentation_of(frame, objects);
  const auto h = std::size_t(camera.height);
  const auto w = std::size_t(camera.width);
  const Intrinsics k = intrinsics_of(camera);
  const std::array<double, 9> intrinsics{k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0};
  const Mat4 rows = frame.world_from_camera.matrix().transpose();  // Eigen keeps columns together

  const std::lock_guard lock(hdf5_mutex());
  Hdf5File file;
  file.add("colors", std::array{h, w, std::size_t(3)}, without_alpha(frame.get(kColor)).data());
  if (params_.depth) {
    file.add("depth", std::array{h, w}, frame.get(kDistanceToImagePlane).pixels().data());
  }
  if (params_.normals) {
    file.add("normals", std::array{h, w, std::size_t(3)},
             mapped_normals(frame.get(kNormals)).data());
  }
  file.add("instance_segmaps", std::array{h, w}, segmentation.instances.data());
  file.add("category_id_segmaps", std::array{h, w}, segmentation.categories.data());
  for (const std::string& channel : params_.channels.names) {
    file.add(channel.c_str(), frame.image_named(channel));
  }
  file.add("cam_K", std::array{std::size_t(3), std::size_t(3)}, intrinsics.data());
  file.add("world_from_camera", std::array{std::size_t(4), std::size_t(4)}, rows.data());
  file.add_text("lens", python_json(lens_json(camera)));
  file.add_text("instance_attribute_maps",
                python_json(attributes_json(objects, training_.classes())));
  return file.bytes();
}

void Hdf5Writer::write(const Capture& capture, CaptureFiles& files) const {
  for (const Frame& frame : capture.frames) {
    files.add(std::string(training_.split(capture.index)) + "/" +
                  training_.image_stem(capture, frame) + ".hdf5",
              frame_file(frame));
  }
}

}  // namespace diorama
