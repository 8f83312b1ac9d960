// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/second_opinion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "framework/datasets/frame_checks.h"
#include "framework/datasets/lens.h"
#include "framework/datasets/object_checks.h"
#include "framework/lint/opencv_geometry.h"
#include "framework/plugins/on_demand_library.h"

namespace diorama {
namespace lint {

const OpencvGeometry& opencv_geometry() {
  static const OpencvGeometry& geometry = [&]() -> const OpencvGeometry& {
    const auto make = reinterpret_cast<const void* (*)()>(
        on_demand_function("diorama_opencv_geometry", "diorama_opencv_geometry"));
    return *static_cast<const OpencvGeometry*>(make());
  }();
  return geometry;
}

}  // namespace lint

namespace {

constexpr const char* kSurface = "surfaces project onto their pixels";
constexpr const char* kReach = "3-D box reaches no farther than its object";

std::string rounded(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

/// Points and the pixels that show them.
struct Sightings {
  std::vector<Vec3> points;
  std::vector<Vec2> pixels;
};

class SecondOpinion {
 public:
  SecondOpinion(const StoredInfo& info, StoredCapture& stored, std::size_t place)
      : info_(info),
        stored_(stored),
        place_(place),
        frame_(stored.capture.frames[place]),
        lens_(lint::lens_of(frame_.camera)),
        camera_from_world_(lint::flipped_axes() * frame_.world_from_camera.inverse()) {}

  void run() {
    if (!holds(kHoldsCamera) || !camera_from_world_.matrix().allFinite()) return;
    check_positions();
    if (!holds(kHoldsPoses) || !holds(kHoldsBounds)) return;
    check_object_coordinates();
    if (holds(kHoldsAmodalBoxes)) check_reach();
  }

 private:
  bool holds(std::string_view name) const { return info_.holds.contains(name); }

  template <class Pixel>
  const Image<Pixel>* image_of(const Channel<Pixel>& channel) const {
    if (!frame_.has(channel.name)) return nullptr;
    const Image<Pixel>& image = frame_.get(channel);
    const bool fits =
        image.width() == frame_.camera.width && image.height() == frame_.camera.height;
    return fits ? &image : nullptr;
  }

  void check(bool is_good, const char* rule, std::string_view held, const std::string& object,
             const std::string& found, const std::string& expected) {
    stored_.log.check(is_good, {rule, file_of(stored_, place_, held), stored_.capture.index,
                                frame_.camera_name, object, found, expected});
  }

  /// While rows are read out one after the other, the camera or things may be elsewhere.
  bool is_instant() const { return frame_.camera.readout_time_s == 0.0; }

  void check_positions() {
    const auto* positions = image_of(kPosition);
    if (!positions || !holds(kHoldsCameraPose) || !is_instant()) return;
    Sightings seen;
    for (const auto& [x, y] : grid({0, 0, positions->width(), positions->height()})) {
      const Vec3 point = positions->at(x, y).cast<double>();
      if (point.isZero(0.0) || !point.allFinite()) continue;
      seen.points.push_back(point);
      seen.pixels.emplace_back(x + 0.5, y + 0.5);
    }
    const double step = step_of(info_, kPosition.name) + step_of(info_, kHoldsCameraPose) +
                        1e-6 * frame_.world_from_camera.translation().norm();
    compare(seen, step, kPosition.name, kHoldsCameraPose, "");
  }

  void check_object_coordinates() {
    const auto* coordinates = image_of(kObjectCoordinates);
    const auto* ids = image_of(kInstanceId);
    if (!coordinates || !ids || !is_instant()) return;
    for (const Instance& instance : frame_.instances) {
      if (instance.bounds_node.is_empty() || !instance.world_from_node.matrix().allFinite() ||
          !instance.tight_box) {
        continue;
      }
      Sightings seen;
      const Vec3 size = instance.bounds_node.size();
      for (const auto& [x, y] : grid(*instance.tight_box)) {
        if (!ids->contains(x, y) || ids->at(x, y) != instance.id) continue;
        const Vec3 share = coordinates->at(x, y).cast<double>();
        if (!share.allFinite()) continue;
        const Vec3 in_node = instance.bounds_node.min + share.cwiseProduct(size);
        seen.points.push_back(instance.world_from_node * in_node);
        seen.pixels.emplace_back(x + 0.5, y + 0.5);
      }
      const double scale = instance.world_from_node.linear().norm();
      const double step = step_of(info_, kObjectCoordinates.name) * scale * size.norm() +
                          step_of(info_, kHoldsPoses) + step_of(info_, kHoldsBounds) * scale;
      compare(seen, step, kObjectCoordinates.name, kHoldsPoses, instance.node_path);
    }
  }

  /// At most some hundred pixels of a box, spread evenly.
  static std::vector<std::pair<int, int>> grid(const PixelBox& box) {
    constexpr int kMost = 24;  // per side
    const int step_x = std::max(1, (box.width() + kMost - 1) / kMost);
    const int step_y = std::max(1, (box.height() + kMost - 1) / kMost);
    std::vector<std::pair<int, int>> places;
    for (int y = box.y_min + step_y / 2; y < box.y_max; y += step_y) {
      for (int x = box.x_min + step_x / 2; x < box.x_max; x += step_x) places.emplace_back(x, y);
    }
    return places;
  }

  /// Points in the world; `step` is their rounding in metres. `held` names what places them.
  void compare(const Sightings& seen, double step, std::string_view channel, std::string_view held,
               const std::string& object) {
    std::vector<Vec3> in_camera;
    for (const Vec3& point : seen.points) in_camera.push_back(camera_from_world_ * point);
    const auto projected = lint::opencv_geometry().project(lens_, in_camera);
    std::size_t all = 0;
    std::size_t wrong = 0;
    double farthest = 0.0;
    Sightings known;
    for (std::size_t i = 0; i < projected.size(); ++i) {
      // What OpenCV does not see behind the camera is wrong as well: a pixel shows it.
      const bool is_behind = !(in_camera[i].z() > 0.0) && lens_.model != lint::Lens::Model::Fisheye;
      if (!projected[i] && !is_behind) continue;
      ++all;
      known.points.push_back(seen.points[i]);
      known.pixels.push_back(seen.pixels[i]);
      const double slack =
          0.25 + 2.0 * step * lens_.focal.maxCoeff() / std::max(in_camera[i].z(), 0.05);
      const double miss = projected[i] ? (*projected[i] - seen.pixels[i]).norm() : 1e9;
      if (miss <= slack) continue;
      ++wrong;
      if (projected[i]) farthest = std::max(farthest, miss);
    }
    if (all < 8) return;
    // Edges of surfaces may be rounded to either side.
    const bool is_good = double(wrong) <= 0.02 * double(all);
    check(is_good, kSurface, held, object,
          is_good ? ""
                  : std::to_string(wrong) + " of " + std::to_string(all) + " pixels of " +
                        std::string(channel) + " show what projects up to " + rounded(farthest) +
                        " pixels beside them",
          is_good ? "" : solved(known));
  }

  /// What solvePnP makes of it.
  std::string solved(const Sightings& seen) const {
    const auto pose = lint::opencv_geometry().solve_pose(lens_, seen.points, seen.pixels);
    if (!pose) return "";
    const Affine between = *pose * camera_from_world_.inverse();
    const double turn = Eigen::AngleAxisd(Mat3(between.linear())).angle() * 180.0 / kPi;
    const Vec3 eye = pose->inverse().translation();
    const double distance = (eye - frame_.world_from_camera.translation()).norm();
    return "seen from a camera turned by " + rounded(turn) + " degrees and " + rounded(distance) +
           " m away";
  }

  /// Every side of the box touches the object, so what is seen of them overlaps.
  void check_reach() {
    constexpr int kParts = 6;
    constexpr int kLeastPixels = 16;
    for (const Instance& instance : frame_.instances) {
      if (!instance.visibility || !instance.visibility->amodal_box ||
          instance.bounds_node.is_empty() || !instance.world_from_node.matrix().allFinite()) {
        continue;
      }
      const PixelBox& seen = *instance.visibility->amodal_box;
      if (seen.width() < kLeastPixels || seen.height() < kLeastPixels) continue;
      const Aabb& bounds = instance.bounds_node;
      const Affine camera_from_node = camera_from_world_ * instance.world_from_node;
      // Thin ends may fall between pixels, cut-out pictures have empty edges.
      const double depth = std::max((camera_from_node * bounds.centre()).z(), 0.05);
      const double rounding = 2.0 * (step_of(info_, kHoldsPoses) + step_of(info_, kHoldsBounds)) *
                              lens_.focal.maxCoeff() / depth;
      const double slack = 2.0 + step_of(info_, kHoldsAmodalBoxes) + rounding +
                           0.2 * std::max(seen.width(), seen.height());
      double farthest = 0.0;
      bool is_whole = true;
      for (int side = 0; side < 6 && is_whole; ++side) {
        const auto extent = extent_of_side(bounds, side, kParts, camera_from_node);
        is_whole = extent.has_value();
        if (!extent) break;
        farthest =
            std::max({farthest, extent->min().x() - seen.x_max, seen.x_min - extent->max().x(),
                      extent->min().y() - seen.y_max, seen.y_min - extent->max().y()});
      }
      if (!is_whole) continue;
      const bool is_good = farthest <= slack;
      check(is_good, kReach, kHoldsPoses, instance.node_path,
            is_good ? "" : "a side of its 3-D box is " + rounded(farthest) + " pixels off it",
            is_good ? "" : "each side touches the object");
    }
  }

  /// Of a side of a box in the picture; nothing unless all of it is inside.
  std::optional<Eigen::AlignedBox2d> extent_of_side(const Aabb& bounds, int side, int parts,
                                                    const Affine& camera_from_node) const {
    const int axis = side / 2;
    std::vector<Vec3> points;
    for (int i = 0; i <= parts; ++i) {
      for (int j = 0; j <= parts; ++j) {
        Vec3 share;
        share[axis] = side % 2;
        share[(axis + 1) % 3] = double(i) / parts;
        share[(axis + 2) % 3] = double(j) / parts;
        points.push_back(camera_from_node * (bounds.min + share.cwiseProduct(bounds.size())));
      }
    }
    Eigen::AlignedBox2d extent;
    const auto pixels = lint::opencv_geometry().project(lens_, points);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (!pixels[i] || !is_imaged(points[i], *pixels[i])) return std::nullopt;
      extent.extend(*pixels[i]);
    }
    return extent;
  }

  /// Distortion may fold what lies far outside of the picture back into it.
  bool is_imaged(const Vec3& point, const Vec2& pixel) const {
    if (!(pixel.array() >= 0.0).all() || pixel.x() > lens_.width || pixel.y() > lens_.height) {
      return false;
    }
    const auto direction = lens_.direction(pixel);
    return direction && direction->normalized().dot(point.normalized()) > 0.999;
  }

  const StoredInfo& info_;
  StoredCapture& stored_;
  std::size_t place_;
  const Frame& frame_;
  lint::Lens lens_;
  Affine camera_from_world_;
};

}  // namespace

void check_second_opinion(const StoredInfo& info, StoredCapture& stored) {
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    SecondOpinion(info, stored, i).run();
  }
}

}  // namespace diorama
