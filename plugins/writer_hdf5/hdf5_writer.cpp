// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_writer.h"

#include <array>
#include <map>
#include <mutex>
#include <span>

#include "writer_hdf5/hdf5_file.h"
#include "writer_support/clips_json.h"
#include "writer_support/cuboid.h"
#include "writer_support/lens_json.h"

namespace diorama {
namespace {

/// One for the process, because the library's state is.
std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

using Number = Hdf5File::Number;

/// Values of a picture, made of some rows at a time.
template <class Value, class Pixel, class Make>
void add_rows(Hdf5File& file, const char* name, Number number, const Image<Pixel>& image,
              std::size_t values, Make&& make) {
  const auto width = std::size_t(image.width());
  const std::array shape{std::size_t(image.height()), width, values};
  std::vector<Value> rows;
  file.add(name, number, std::span(shape).first(values > 1 ? 3 : 2),
           [&](std::size_t first, std::size_t count) -> const void* {
             rows.clear();
             const auto pixels = image.pixels().subspan(first * width, count * width);
             for (const Pixel& pixel : pixels) make(pixel, rows);
             return rows.data();
           });
}

void add_segmentation(Hdf5File& file, const Frame& frame,
                      const std::vector<TrainingObject>& objects) {
  std::map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < objects.size(); ++i) place.emplace(objects[i].instance->id, i);
  const auto add = [&](const char* name, auto&& value_of) {
    add_rows<std::uint16_t>(
        file, name, Number::U16, frame.get(kInstanceId), 1,
        [&](std::uint32_t id, std::vector<std::uint16_t>& rows) {
          const auto found = place.find(id);
          rows.push_back(found == place.end() ? std::uint16_t(0) : value_of(found->second));
        });
  };
  add("instance_segmaps", [](std::size_t i) { return std::uint16_t(i + 1); });
  add("category_id_segmaps",
      [&](std::size_t i) { return std::uint16_t(objects[i].class_index + 1); });
}

Json attributes_json(const std::vector<TrainingObject>& objects,
                     const std::vector<std::string>& classes) {
  Json list = Json::array();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const Instance& instance = *objects[i].instance;
    list.push_back({{"idx", i + 1},
                    {"name", instance.node_path},
                    {"category_id", objects[i].class_index + 1},
                    {"class", classes[std::size_t(objects[i].class_index)]}});
    add_pose(instance, list.back());
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
                                         "clip",
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

void Hdf5Writer::write_frame(const Capture& capture, const Frame& frame, CaptureFiles& files,
                             const std::string& path) const {
  const Camera& camera = frame.camera;
  const auto objects = training_.objects(frame);
  const Intrinsics k = intrinsics_of(camera);
  const std::array<double, 9> intrinsics{k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0};
  const Mat4 rows = frame.world_from_camera.matrix().transpose();  // Eigen keeps columns together

  const std::lock_guard lock(hdf5_mutex());
  Hdf5File file;
  add_rows<std::uint8_t>(file, "colors", Number::U8, frame.get(kColor), 3,
                         [](const Rgba8& pixel, std::vector<std::uint8_t>& to) {
                           to.insert(to.end(), pixel.begin(), pixel.begin() + 3);
                         });
  if (params_.depth) file.add("depth", frame.image_named(kDistanceToImagePlane.name));
  if (params_.normals) {
    add_rows<float>(file, "normals", Number::F32, frame.get(kNormals), 3,
                    [](const Vec3f& normal, std::vector<float>& to) {
                      for (int axis = 0; axis < 3; ++axis)
                        to.push_back(0.5f * (normal[axis] + 1.0f));
                    });
  }
  add_segmentation(file, frame, objects);
  for (const std::string& channel : params_.channels.names) {
    file.add(channel.c_str(), frame.image_named(channel));
  }
  file.add("cam_K", std::array{std::size_t(3), std::size_t(3)}, intrinsics.data());
  file.add("world_from_camera", std::array{std::size_t(4), std::size_t(4)}, rows.data());
  file.add_text("lens", python_json(lens_json(camera)));
  if (capture.clip) {
    Json clip = Json::object();
    add_clip_frame(capture, clip);
    file.add_text("clip", python_json(clip));
  }
  file.add_text("instance_attribute_maps",
                python_json(attributes_json(objects, training_.classes())));
  file.append_to(files, path);
}

void Hdf5Writer::write(const Capture& capture, CaptureFiles& files) const {
  for (const Frame& frame : capture.frames) {
    write_frame(capture, frame, files,
                std::string(training_.split(capture.index)) + "/" +
                    training_.image_stem(capture, frame) + ".hdf5");
  }
}

}  // namespace diorama
