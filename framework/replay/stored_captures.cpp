// SPDX-License-Identifier: Apache-2.0
#include "framework/replay/stored_captures.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "diorama/error.h"
#include "framework/config/json_text.h"
#include "framework/config/yaml_config.h"
#include "framework/images/linear_picture.h"
#include "framework/lint/replicator_files.h"
#include "framework/output/file_system.h"
#include "framework/pipeline/capture_plan.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using lint::Json;

constexpr const char* kCameraFile = "camera_params.json";

/// How BasicWriter stores a channel, and the parameters that make it do so.
struct Storage {
  std::string_view channel;
  const char* file;
  std::vector<std::pair<const char*, const char*>> parameters;
};

const std::vector<Storage>& storages() {
  static const std::vector<Storage> all{
      {kColorHdr.name, "rgb.exr", {{"rgb", "true"}, {"image_output_format", "exr"}}},
      {kDistanceToImagePlane.name,
       "distance_to_image_plane.npy",
       {{"distance_to_image_plane", "true"}}}};
  return all;
}

const Storage& storage_of(std::string_view channel) {
  return *std::ranges::find(storages(), channel, &Storage::channel);
}

bool is_set(const Value& entry, const char* key, std::string_view value) {
  const Value* found = entry.find(key);
  return found && found->kind == Value::Kind::Scalar && found->scalar == value;
}

/// What a writer's entry has to say for the channels to be stored.
std::vector<std::pair<const char*, const char*>> wanted_parameters(const NameSet& channels) {
  std::vector<std::pair<const char*, const char*>> wanted{{"camera_params", "true"}};
  for (const std::string& channel : channels) {
    const auto& own = storage_of(channel).parameters;
    wanted.insert(wanted.end(), own.begin(), own.end());
  }
  return wanted;
}

Camera camera_from(const lint::Lens& lens) {
  Camera camera;
  camera.width = lens.width;
  camera.height = lens.height;
  if (lens.model == lint::Lens::Model::Opencv) camera.lens = LensModel::OpencvPinhole;
  if (lens.model == lint::Lens::Model::Fisheye) camera.lens = LensModel::FisheyePolynomial;
  camera.fx = lens.focal.x();
  camera.fy = lens.focal.y();
  camera.cx = lens.centre.x();
  camera.cy = lens.centre.y();
  camera.distortion = lens.distortion;
  camera.fisheye_polynomial = lens.polynomial;
  camera.fisheye_max_angle_rad = lens.max_angle;
  return camera;
}

[[noreturn]] void refuse(const fs::path& file, const std::string& why) {
  throw Error(ErrorKind::Asset, file.string() + ": " + why);
}

Camera read_camera(const fs::path& file) {
  const std::string text = LocalFileSystem().read(file);
  try {
    const Camera camera = camera_from(lint::camera_of(parse_json(text)).lens);
    constexpr int kMost = 16384;
    if (camera.width < 1 || camera.width > kMost || camera.height < 1 || camera.height > kMost) {
      throw std::runtime_error("has a resolution outside of 1 to 16384 pixels a side");
    }
    return camera;
  } catch (const std::exception& error) {
    refuse(file, error.what());
  }
}

Image<float> read_distances(const fs::path& file, const Camera& camera) {
  const std::string bytes = LocalFileSystem().read(file);
  try {
    const lint::NpyArray array = lint::parse_npy(bytes);
    const std::vector<std::size_t> shape{std::size_t(camera.height), std::size_t(camera.width)};
    if (array.shape != shape || array.item_size != sizeof(float)) {
      throw std::runtime_error("has another size than the camera");
    }
    Image<float> image(camera.width, camera.height, 0.0f);
    std::memcpy(image.pixels().data(), array.data.data(), array.data.size());
    return image;
  } catch (const std::runtime_error& error) {
    refuse(file, error.what());
  }
}

}  // namespace

NameSet StoredCaptures::stored_channels() {
  NameSet names;
  for (const Storage& storage : storages()) names.emplace(storage.channel);
  return names;
}

StoredCaptures::StoredCaptures(const fs::path& folder, const NameSet& channels)
    : channels_(channels) {
  const fs::path file = folder / "dataset.json";
  if (!fs::is_regular_file(file)) {
    throw Error(ErrorKind::Usage,
                folder.string() + ": holds no dataset.json; give the output folder of a run");
  }
  dataset_json_ = LocalFileSystem().read(file);
  std::string job;
  try {
    const Json json = parse_json(dataset_json_);
    seed_ = json.at("seed").get<std::uint64_t>();
    capture_count_ = json.at("captures").get<int>();
    camera_names_ = json.at("cameras").get<std::vector<std::string>>();
    job = json.at("job").get<std::string>();
    if (capture_count_ < 0) throw std::runtime_error("a negative number of captures");
  } catch (const std::exception& error) {
    refuse(file, "is not the description of a run's dataset (" + std::string(error.what()) + ")");
  }
  choose_writer(folder, job);
  list_files();
}

void StoredCaptures::choose_writer(const fs::path& folder, const std::string& job) {
  const Value resolved = parse_yaml(job, "job of " + folder.string());
  const auto wanted = wanted_parameters(channels_);
  const Value* writers = resolved.find("writers");
  for (const Value& entry : writers ? writers->list : std::vector<Value>()) {
    const bool fits = is_set(entry, "type", "BasicWriter") &&
                      std::ranges::all_of(wanted, [&](const auto& parameter) {
                        return is_set(entry, parameter.first, parameter.second);
                      });
    const Value* place = entry.find("output_dir");
    const Value* name = entry.find("name");
    if (!fits || !place || !name) continue;
    // What is made of this dataset goes into a folder of the writer's name.
    const std::string& folder_name = name->scalar;
    const bool is_plain = !folder_name.empty() && !folder_name.starts_with('.') &&
                          folder_name.find('/') == std::string::npos;
    const fs::path relative = fs::path(place->scalar).lexically_normal();
    const bool is_below = relative.is_relative() && *relative.begin() != "..";
    if (!is_plain || !is_below) {
      refuse(folder / "dataset.json", "its writer '" + folder_name + "' in '" + place->scalar +
                                          "' lies outside of the dataset");
    }
    writer_ = entry;
    writer_name_ = folder_name;
    writer_folder_ = (folder / place->scalar).lexically_normal();
    return;
  }
  std::string list;
  for (const auto& [key, value] : wanted) {
    list += std::string(list.empty() ? "" : ", ") + key + ": " + value;
  }
  throw Error(ErrorKind::Usage, folder.string() +
                                    ": no writer stored what the effects need; that takes a "
                                    "BasicWriter with {" +
                                    list + "}");
}

void StoredCaptures::list_files() {
  LintReport report;
  const lint::Dataset dataset(writer_folder_, report);
  const lint::ReplicatorFiles files(dataset);
  const bool is_flat = camera_names_.size() == 1;
  std::vector<std::string> kinds{kCameraFile};
  for (const std::string& channel : channels_) kinds.emplace_back(storage_of(channel).file);
  for (const std::string& number : files.numbers()) {
    std::vector<FrameFiles> frames;
    bool is_whole = true;
    for (const std::string& camera : camera_names_) {
      FrameFiles& frame = frames.emplace_back();
      for (const std::string& kind : kinds) {
        const std::string path = files.path(is_flat ? "" : "rp_" + camera, number, kind);
        is_whole = is_whole && !path.empty();
        frame[kind] = writer_folder_ / path;
      }
    }
    int index = 0;
    const char* end = number.data() + number.size();
    const bool is_index = std::from_chars(number.data(), end, index).ec == std::errc();
    if (is_whole && is_index) captures_[index] = std::move(frames);
  }
  if (captures_.empty()) {
    throw Error(ErrorKind::Usage, writer_folder_.string() + ": holds no whole capture");
  }
}

std::vector<int> StoredCaptures::indices() const {
  std::vector<int> list;
  for (const auto& [index, files] : captures_) list.push_back(index);
  return list;
}

Capture StoredCaptures::read(int index, const Host& host) const {
  const std::vector<FrameFiles>& frames = captures_.at(index);
  Capture capture;
  capture.index = index;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    capture.frames.push_back(read_frame(camera_names_[i], index, frames[i], host));
  }
  return capture;
}

Frame StoredCaptures::read_frame(const std::string& camera, int index, const FrameFiles& files,
                                 const Host& host) const {
  Frame frame;
  frame.camera_name = camera;
  frame.camera_path = "/Cameras/" + camera;
  frame.camera = read_camera(files.at(kCameraFile));
  frame.seed = JobStreams(seed_).render_seed(index, camera);
  if (channels_.contains(kColorHdr.name)) {
    const fs::path& file = files.at(storage_of(kColorHdr.name).file);
    frame.set(kColorHdr, read_linear_picture(file, frame.camera.width, frame.camera.height, host));
  }
  if (channels_.contains(kDistanceToImagePlane.name)) {
    const fs::path& file = files.at(storage_of(kDistanceToImagePlane.name).file);
    frame.set(kDistanceToImagePlane, read_distances(file, frame.camera));
  }
  return frame;
}

}  // namespace diorama
