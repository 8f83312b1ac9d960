// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_stats.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <set>
#include <string_view>

#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/pixel_boxes.h"
#include "framework/datasets/pixel_counts.h"

namespace diorama {
namespace {

/// Shares of a picture from which on it is worth a look.
constexpr double kBlack = 0.02;
constexpr double kBurntShare = 0.5;
constexpr float kCloseM = 0.15f;
constexpr double kCloseShare = 0.5;
constexpr double kMovingPx = 1.0;

struct SeenObject {
  std::string name;
  std::optional<double> box_side;
  Vec2 place = Vec2::Zero();  ///< Of the box: shares of the picture.
  std::optional<double> visible;
  std::optional<double> truncation;
  std::optional<double> distance_m;
  std::optional<std::pair<std::size_t, std::size_t>> view;  ///< Elevation, azimuth.
};

/// One picture, reduced to what is counted.
struct SeenPicture {
  std::string camera;
  int width = 0;
  int height = 0;
  std::vector<SeenObject> objects;
  std::optional<double> brightness;
  std::vector<const char*> suspicions;
};

struct SeenCapture {
  int index = 0;
  std::string split;
  std::vector<SeenPicture> pictures;
  std::size_t findings = 0;
};

std::size_t bin(double share, std::size_t bins) {
  return std::size_t(std::clamp(share * double(bins), 0.0, double(bins) - 1.0));
}

/// Of all red, green and blue values of a picture.
double brightness_of_sum(std::uint64_t sum, std::size_t pixels) {
  return double(sum) / (3.0 * 255.0 * double(std::max<std::size_t>(pixels, 1)));
}

/// Measures frames of one dataset.
class Measurement {
 public:
  explicit Measurement(const StoredInfo& info) : info_(info) {}

  SeenCapture measure(const StoredCapture& stored) const {
    SeenCapture seen;
    seen.index = stored.capture.index;
    seen.split = stored.split;
    seen.findings = stored.log.findings.size();
    for (const Frame& frame : stored.capture.frames) seen.pictures.push_back(picture(frame));
    return seen;
  }

 private:
  bool holds(std::string_view name) const { return info_.holds.contains(name); }

  SeenPicture picture(const Frame& frame) const {
    SeenPicture seen;
    seen.camera = frame.camera_name;
    seen.width = frame.camera.width;
    seen.height = frame.camera.height;
    for (const Instance& instance : frame.instances) {
      if (auto one = object(frame, instance)) seen.objects.push_back(std::move(*one));
    }
    if (holds(kHoldsInstances) && seen.objects.empty()) seen.suspicions.push_back("no object");
    if (frame.has(kColor.name)) judge_color(frame.get(kColor), seen);
    judge_depth(frame, seen);
    if (frame.has(kMotion.name) && frame.has(kInstanceId.name)) judge_motion(frame, seen);
    return seen;
  }

  /// Nothing for what is not in the picture. Where nothing tells of that, each object counts.
  std::optional<SeenObject> object(const Frame& frame, const Instance& instance) const {
    SeenObject seen;
    seen.name = class_of(instance);
    if (instance.tight_box && !instance.tight_box->is_empty()) {
      const PixelBox& box = *instance.tight_box;
      const double width = std::max(frame.camera.width, 1);
      const double height = std::max(frame.camera.height, 1);
      seen.box_side = std::sqrt(double(box.width()) * box.height() / (width * height));
      seen.place = {0.5 * (box.x_min + box.x_max) / width, 0.5 * (box.y_min + box.y_max) / height};
    } else if (holds(kHoldsTightBoxes) || holds(kInstanceId.name)) {
      return std::nullopt;
    }
    if (instance.visibility && holds(kHoldsOcclusion)) {
      if (const auto occlusion = instance.visibility->occlusion()) seen.visible = 1.0 - *occlusion;
    }
    if (instance.visibility && holds(kHoldsTruncation)) {
      seen.truncation = instance.visibility->truncation();
    }
    if (const auto from = seen_from(info_, frame, instance)) {
      seen.distance_m = from->distance_m;
      const double turn = from->azimuth / (2.0 * kPi);
      seen.view = {bin(from->elevation / kPi + 0.5, kElevations),
                   bin(turn < 0.0 ? turn + 1.0 : turn, kAzimuths)};
    }
    return seen;
  }

  static void judge_color(const Image<Rgba8>& image, SeenPicture& seen) {
    const ColorCounts counts = color_counts(image.pixels());
    const std::size_t size = image.pixels().size();
    seen.brightness = brightness_of_sum(counts.sum, size);
    if (*seen.brightness < kBlack) {
      seen.suspicions.push_back("black");
    } else if (double(counts.burnt) > kBurntShare * double(size)) {
      seen.suspicions.push_back("burnt");
    } else if (counts.is_uniform) {
      seen.suspicions.push_back("one colour");
    }
  }

  static void judge_depth(const Frame& frame, SeenPicture& seen) {
    for (const Channel<float>& channel : {kDistanceToImagePlane, kDistanceToCamera}) {
      if (!frame.has(channel.name)) continue;
      const auto pixels = frame.get(channel).pixels();
      if (double(count_below(pixels, kCloseM)) > kCloseShare * double(pixels.size())) {
        seen.suspicions.push_back("something close before the camera");
      }
      return;
    }
  }

  static void judge_motion(const Frame& frame, SeenPicture& seen) {
    const auto motion = frame.get(kMotion).pixels();
    const auto ids = frame.get(kInstanceId).pixels();
    const bool is_moving = [&] {
      for (std::size_t i = 0; i < motion.size(); ++i) {
        if (ids[i] != 0 && double(motion[i].norm()) > kMovingPx) return true;
      }
      return false;
    }();
    if (is_moving) seen.suspicions.push_back("moving");
  }

  const StoredInfo& info_;
};

/// What is counted: of pixels only what nothing smaller tells.
NameSet wanted_of(const StoredInfo& info) {
  NameSet wanted = info.holds;
  const auto leave_out = [&](std::initializer_list<std::string_view> names) {
    for (const std::string_view name : names) {
      if (const auto found = wanted.find(name); found != wanted.end()) wanted.erase(found);
    }
  };
  leave_out({"amodal_mask", "occlusion_order", "pointcloud", kColorHdr.name, kNormals.name,
             kPosition.name, kLeafId.name, kFlowForward.name, kFlowForwardState.name,
             kFlowBackward.name, kFlowBackwardState.name, kSensorDepth.name});
  // One of the two says what is close.
  if (wanted.contains(kDistanceToImagePlane.name)) leave_out({kDistanceToCamera.name});
  // Which pixels move, or where objects are that have no boxes.
  const bool needs_ids = wanted.contains(kMotion.name) || !wanted.contains(kHoldsTightBoxes);
  if (!needs_ids) leave_out({kInstanceId.name});
  return wanted;
}

void add(const SeenObject& object, ClassStats& own) {
  ++own.objects;
  if (object.box_side) {
    own.box_side.add(*object.box_side);
    ++own.places[bin(object.place.y(), kHeatRows)][bin(object.place.x(), kHeatColumns)];
  }
  if (object.visible) own.visible.add(*object.visible);
  if (object.truncation) own.truncation.add(*object.truncation);
  if (object.distance_m) own.distance_m.add(*object.distance_m);
  if (object.view) ++own.views[object.view->first][object.view->second];
}

void add(const SeenCapture& capture, DatasetStats& stats) {
  ++stats.captures;
  stats.findings += std::int64_t(capture.findings);
  for (const SeenPicture& picture : capture.pictures) {
    ++stats.pictures;
    ++stats.pictures_by_camera[picture.camera];
    if (!capture.split.empty()) ++stats.pictures_by_split[capture.split];
    ++stats
          .pictures_by_size[std::to_string(picture.width) + " x " + std::to_string(picture.height)];
    stats.objects_per_picture.add(double(picture.objects.size()));
    if (picture.brightness) stats.brightness.add(*picture.brightness);
    std::set<std::string> here;
    for (const SeenObject& object : picture.objects) {
      ClassStats& own = stats.classes[object.name];
      add(object, own);
      if (here.insert(object.name).second) ++own.pictures;
    }
    for (const char* what : picture.suspicions) {
      SuspiciousPictures& list = stats.suspicious[what];
      ++list.count;
      if (list.names.size() < SuspiciousPictures::kMostNames) {
        list.names.push_back("capture " + std::to_string(capture.index) + ", " + picture.camera);
      }
    }
  }
}

}  // namespace

std::string class_of(const Instance& instance) {
  if (const auto label = instance.labels.find("class"); label != instance.labels.end()) {
    return label->second;
  }
  return instance.labels.empty() ? std::string() : instance.labels.begin()->second;
}

double mean_brightness(const Image<Rgba8>& image) {
  return brightness_of_sum(color_counts(image.pixels()).sum, image.pixels().size());
}

std::optional<SeenFrom> seen_from(const StoredInfo& info, const Frame& frame,
                                  const Instance& instance) {
  const bool has_boxes = info.holds.contains(kHoldsBoxes3d);
  if (!has_boxes && !info.holds.contains(kHoldsPoses)) return std::nullopt;
  const bool has_bounds = has_boxes && !instance.bounds_node.is_empty();
  const Vec3 middle = has_bounds ? instance.bounds_node.centre() : Vec3(Vec3::Zero());
  const Vec3 camera = frame.world_from_camera.translation();
  const Vec3 view = instance.world_from_node.inverse() * camera - middle;
  if (!view.allFinite() || view.norm() == 0.0) return std::nullopt;
  return SeenFrom{(instance.world_from_node * middle - camera).norm(),
                  std::atan2(view.y(), view.x()),
                  std::asin(std::clamp(view.z() / view.norm(), -1.0, 1.0))};
}

void Histogram::add(double value) {
  if (std::isnan(value)) return;
  ++counts_[bin((value - low_) / (high_ - low_), counts_.size())];
  ++total_;
  sum_ += value;
  least_ = std::min(least_, value);
  most_ = std::max(most_, value);
}

DatasetStats dataset_stats(const StoredDataset& dataset, Host& host) {
  const StoredInfo& info = dataset.info();
  DatasetStats stats;
  stats.format = info.format;
  stats.holds = info.holds;
  stats.findings = std::int64_t(dataset.log().findings.size());
  // Classes without an object are worth knowing.
  for (const std::string& name : info.classes) stats.classes.try_emplace(name);
  const Measurement measurement(info);
  sweep_captures<SeenCapture>(
      dataset, wanted_of(info), host,
      [&](StoredCapture stored) {
        for (Frame& frame : stored.capture.frames) complete_boxes(frame);
        return measurement.measure(stored);
      },
      [&](const SeenCapture& capture) { add(capture, stats); }, kSmallResults);
  return stats;
}

}  // namespace diorama
