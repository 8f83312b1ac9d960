// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/basic_reader.h"

#include <algorithm>

#include "diorama/error.h"
#include "reader_support/capture_rows.h"
#include "reader_support/clip_list.h"
#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"
#include "writer_basic/basic_files.h"
#include "writer_basic/basic_frame.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "BasicWriter";
constexpr std::string_view kProduct = "rp_";

std::string camera_of(const std::string& product) {
  if (product.empty()) return "camera";
  return product.starts_with(kProduct) ? product.substr(kProduct.size()) : product;
}

class BasicDataset final : public StoredDataset {
 public:
  BasicDataset(fs::path folder, const Host& host)
      : folder_(std::move(folder)), host_(host), names_(folder_) {
    if (names_.numbers().empty() && metadata_writer(folder_) != kFormat) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no files of BasicWriter");
    }
    check_numbers();
    read_clips();
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }

  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    const int number = info_.captures.at(i);
    return read_frames(
        number, clips_, names_.products(),
        [&](const std::string& product, StoredCapture& stored, FrameSources& sources) {
          const std::string camera = camera_of(product);
          StoredFiles files(folder_, host_, stored.log, number, camera);
          check_complete(product, number, files);
          return BasicFrameReading(names_, product, number, wanted, files).read(camera, sources);
        });
  }

 private:
  void check_numbers() {
    StoredFiles files(folder_, host_, log_);
    if (files.has("metadata.txt")) {
      files.check(metadata_writer(folder_) == kFormat, kReadable, "metadata.txt", "",
                  "does not say that BasicWriter wrote this");
    }
    for (const std::string& name : names_.unnumbered()) {
      files.find(kReadable, name, "", "its number is beyond reason");
    }
    const std::vector<int> numbers = names_.numbers();
    if (numbers.empty()) return;
    files.check(numbers.size() == std::size_t(numbers.back()) + 1, kMissing, ".", "",
                "there are " + std::to_string(numbers.size()) + " frames",
                "their numbers end with " + std::to_string(numbers.back()));
  }

  void read_clips() {
    constexpr const char* kFile = "clips.json";
    StoredFiles files(folder_, host_, log_);
    if (!files.has(kFile)) return;
    const auto json = files.json(kFile);
    if (!json) return;
    files.reading(kFile, [&] {
      clips_ = clips_of_json(json->at("clips"));
      const std::vector<int> numbers = names_.numbers();
      const int end = numbers.empty() ? 0 : numbers.back() + 1;
      for (const DatasetClip& clip : clips_) {
        files.check(clip.first + clip.count <= end, kCounts, kFile, "",
                    "a clip ends with capture " + std::to_string(clip.first + clip.count - 1),
                    "the last capture is " + std::to_string(end - 1));
      }
    });
  }

  /// What other frames have.
  void check_complete(const std::string& product, int number, StoredFiles& files) const {
    for (const std::string& kind : names_.kinds()) {
      const std::string expected = names_.expected_path(product, number, kind);
      files.check(!names_.path(product, number, kind).empty(), kMissing, expected, "",
                  "the file is not there", "other frames have " + kind);
    }
  }

  void describe() {
    info_.format = kFormat;
    for (const std::string& product : names_.products()) {
      info_.camera_names.push_back(camera_of(product));
    }
    info_.captures = names_.numbers();
    const auto hold = [&](std::string_view kind, std::initializer_list<std::string_view> names) {
      if (names_.has(kind)) info_.holds.insert(names.begin(), names.end());
    };
    for (const char* kind : {"rgb.png", "rgb.jpg", "rgb.jpeg"}) hold(kind, {kColor.name});
    hold("rgb.exr", {kColorHdr.name});
    hold("normals.png", {kNormals.name});
    hold("distance_to_camera.npy", {kDistanceToCamera.name});
    hold("distance_to_image_plane.npy", {kDistanceToImagePlane.name});
    hold("sensor_depth.npy", {kSensorDepth.name});
    hold("motion_vectors.npy", {kMotion.name});
    for (const std::string_view flow :
         {kFlowForward.name, kFlowBackward.name, kFlowForwardState.name, kFlowBackwardState.name}) {
      hold(std::string(flow) + ".npy", {flow});
    }
    hold("velocities.json", {kHoldsVelocities});
    note_clips(clips_, info_);
    hold("camera_params.json", {kHoldsCamera, kHoldsCameraPose});
    hold("joint_states.json", {kHoldsJoints});
    hold("instance_segmentation.png",
         {kInstanceId.name, kHoldsInstances, kHoldsLabels, kHoldsNodePaths});
    hold("instance_id_segmentation.png", {kLeafId.name, kHoldsLeafPaths});
    hold("semantic_segmentation.png", {kHoldsLabels});
    const std::string nameless = names_.nameless_boxes();
    const auto hold_boxes = [&](const char* kind, std::initializer_list<std::string_view> names) {
      if (nameless.empty() || nameless == kind) hold(std::string(kind) + ".npy", names);
    };
    hold_boxes("bounding_box_2d_tight",
               {kHoldsInstances, kHoldsLabels, kHoldsNodePaths, kHoldsTightBoxes, kHoldsOcclusion});
    hold_boxes("bounding_box_2d_loose", {kHoldsInstances, kHoldsLabels, kHoldsNodePaths,
                                         kHoldsAmodalBoxes, kHoldsOcclusion});
    hold_boxes("bounding_box_3d",
               {kHoldsInstances, kHoldsLabels, kHoldsNodePaths, kHoldsPoses, kHoldsBounds,
                kHoldsBoxes3d, kHoldsOcclusion, kHoldsUnseenInstances});
    if (!names_.has_node_paths()) info_.holds.erase(std::string(kHoldsNodePaths));
    hold("occlusion.npy", {kHoldsOcclusion});
    hold("pointcloud.npy", {"pointcloud"});
    info_.steps[std::string(kNormals.name)] = 0.01;
    if (!names_.has("rgb.png")) info_.steps[std::string(kColor.name)] = 16.0;
  }

  fs::path folder_;
  const Host& host_;
  BasicFiles names_;
  StoredInfo info_;
  std::vector<DatasetClip> clips_;
  ReadLog log_;
};

}  // namespace

std::vector<std::string> BasicReader::patterns() const {
  return {"metadata.txt",         "rgb_*.*",   "*/rgb/rgb_*.*",        "rgb/*_rgb_*.*",
          "camera_params_*.json", "*/*/*.npy", "*/*/*_mapping_*.json", "*.npy"};
}

Recognition BasicReader::recognise(const fs::path& folder) const {
  const std::string said = metadata_writer(folder);
  if (said == kFormat) return Recognition::ByName;
  if (!said.empty()) return Recognition::No;
  return BasicFiles(folder).numbers().empty() ? Recognition::No : Recognition::ByFiles;
}

std::unique_ptr<const StoredDataset> BasicReader::open(const fs::path& folder) const {
  return std::make_unique<BasicDataset>(folder, host_);
}

}  // namespace diorama
