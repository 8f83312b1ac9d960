// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/frame_difference.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <type_traits>

#include "framework/datasets/frame_checks.h"

namespace diorama {
namespace {

/// Relative, for what passes through 32-bit numbers.
constexpr double kSingle = 1e-6;
/// Boxes that are rounded to more do not tell objects apart.
constexpr double kTellingStep = 16.0;

bool is_near(double a, double b, double step) {
  if (a == b) return true;
  return std::abs(a - b) <= step + kSingle * std::max(std::abs(a), std::abs(b));
}
bool is_near(float a, float b, double step) { return is_near(double(a), double(b), step); }
bool is_near(const Vec2f& a, const Vec2f& b, double step) {
  return is_near(a.x(), b.x(), step) && is_near(a.y(), b.y(), step);
}
bool is_near(const Vec3f& a, const Vec3f& b, double step) {
  return is_near(a.x(), b.x(), step) && is_near(a.y(), b.y(), step) && is_near(a.z(), b.z(), step);
}
/// Alpha is no part of a picture.
bool is_near(const Rgba8& a, const Rgba8& b, double step) {
  for (std::size_t c = 0; c < 3; ++c) {
    if (std::abs(int(a[c]) - int(b[c])) > int(step)) return false;
  }
  return true;
}
bool is_near(std::uint32_t a, std::uint32_t b, double) { return a == b; }

bool is_near(const Affine& a, const Affine& b, double step) {
  return ((a.matrix() - b.matrix()).array().abs() <=
          step + 1e-5 * (1.0 + b.matrix().array().abs().maxCoeff()))
      .all();
}

class FrameComparison {
 public:
  FrameComparison(const StoredInfo& info, const Frame& written, const Frame& read)
      : info_(info), written_(written), read_(read) {}

  std::vector<std::string> run() {
    if (read_.camera.width != written_.camera.width ||
        read_.camera.height != written_.camera.height) {
      differ("the size of the picture");
      return std::move(differences_);
    }
    if (holds(kHoldsCamera)) compare_camera();
    if (holds(kHoldsCameraPose) &&
        !is_near(written_.world_from_camera, read_.world_from_camera, step(kHoldsCameraPose))) {
      differ("the camera's pose");
    }
    for (const std::string& name : written_.channels()) {
      if (holds(name) && !read_.has(name)) differ(name + " is not there");
    }
    for (const std::string& name : read_.channels()) compare_channel(name);
    match_instances();
    for (const Instance& instance : read_.instances) compare_instance(instance);
    return std::move(differences_);
  }

 private:
  bool holds(std::string_view name) const { return info_.holds.contains(name); }
  double step(std::string_view name) const { return step_of(info_, name); }
  void differ(const std::string& what) { differences_.push_back(read_.camera_name + ": " + what); }

  void compare_camera() {
    const Camera& a = written_.camera;
    const Camera& b = read_.camera;
    const double pixels = step(kHoldsCamera);
    // A fisheye's polynomial says its focal length.
    const bool has_focal_length = a.lens != LensModel::FisheyePolynomial;
    bool is_same =
        a.lens == b.lens && is_near(a.cx, b.cx, pixels) && is_near(a.cy, b.cy, pixels) &&
        (!has_focal_length || (is_near(a.fx, b.fx, pixels) && is_near(a.fy, b.fy, pixels)));
    for (std::size_t i = 0; i < a.distortion.size() && a.lens == LensModel::OpencvPinhole; ++i) {
      is_same = is_same && is_near(a.distortion[i], b.distortion[i], 1e-6);
    }
    if (!is_same) differ("intrinsics or lens");
  }

  /// With loss, single pixels say nothing.
  void compare_lossy(const Image<Rgba8>& a, const Image<Rgba8>& b) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < a.pixels().size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        sum += std::uint64_t(std::abs(int(a.pixels()[i][c]) - int(b.pixels()[i][c])));
      }
    }
    const double all = 3.0 * double(std::max<std::size_t>(a.pixels().size(), 1));
    if (double(sum) > step(kColor.name) * all) differ("color in the mean");
  }

  void compare_channel(const std::string& name) {
    if (name == kInstanceId.name || name == kLeafId.name || !written_.has(name)) return;
    const AnyImage& a = written_.image_named(name);
    const AnyImage& b = read_.image_named(name);
    if (a.index() != b.index()) return differ("the pixel type of " + name);
    std::visit(
        [&]<class Pixel>(const Image<Pixel>& image) {
          const auto& other = std::get<Image<Pixel>>(b);
          if (image.width() != other.width() || image.height() != other.height()) {
            return differ("the size of " + name);
          }
          if constexpr (std::is_same_v<Pixel, Rgba8>) {
            if (step(name) > 0.0) return compare_lossy(image, other);
          }
          std::size_t wrong = 0;
          for (std::size_t i = 0; i < image.pixels().size(); ++i) {
            if (!is_near(image.pixels()[i], other.pixels()[i], step(name))) ++wrong;
          }
          if (wrong > 0) differ(name + " in " + std::to_string(wrong) + " pixels");
        },
        a);
  }

  /// By pixels, else by path, else by box.
  void match_instances() {
    if (read_.has(kInstanceId.name) && written_.has(kInstanceId.name)) match_pixels();
    for (const Instance& instance : read_.instances) {
      if (partners_.contains(instance.id)) continue;
      const auto found = std::ranges::find_if(written_.instances, [&](const Instance& other) {
        if (holds(kHoldsNodePaths)) return other.node_path == instance.node_path;
        return can_tell_by_box() && other.tight_box && instance.tight_box &&
               is_near_box(*other.tight_box, *instance.tight_box);
      });
      if (found != written_.instances.end()) partners_.emplace(instance.id, &*found);
    }
  }

  bool is_near_box(const PixelBox& a, const PixelBox& b) const {
    const int slack = int(std::ceil(step(kHoldsTightBoxes)));
    return std::abs(a.x_min - b.x_min) <= slack && std::abs(a.y_min - b.y_min) <= slack &&
           std::abs(a.x_max - b.x_max) <= slack && std::abs(a.y_max - b.y_max) <= slack;
  }

  bool can_tell_by_box() const {
    return holds(kHoldsTightBoxes) && step(kHoldsTightBoxes) < kTellingStep;
  }

  void match_pixels() {
    const auto a = written_.get(kInstanceId).pixels();
    const auto b = read_.get(kInstanceId).pixels();
    std::map<std::uint32_t, std::uint32_t> written_of;
    std::map<std::uint32_t, std::uint32_t> read_of;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (a[i] == 0 && b[i] == 0) continue;
      const auto [to, is_new] = read_of.emplace(a[i], b[i]);
      const auto [back, is_new_back] = written_of.emplace(b[i], a[i]);
      const bool fits = to->second == b[i] && (b[i] == 0 || (back->second == a[i] && a[i] != 0));
      if (!fits) ++wrong;
    }
    if (wrong > 0) differ("instance_id in " + std::to_string(wrong) + " pixels");
    for (const auto& [to, from] : written_of) {
      const auto found = std::ranges::find(written_.instances, from, &Instance::id);
      if (to != 0 && found != written_.instances.end()) partners_.emplace(to, &*found);
    }
  }

  void compare_instance(const Instance& instance) {
    const auto partner = partners_.find(instance.id);
    const std::string who = instance.node_path;
    if (partner == partners_.end()) {
      const bool can_tell = holds(kHoldsNodePaths) || can_tell_by_box();
      if (can_tell) differ(who + " was not written");
      return;
    }
    const Instance& written = *partner->second;
    if (holds(kHoldsNodePaths) && written.node_path != instance.node_path) {
      differ(who + " was " + written.node_path);
    }
    if (holds(kHoldsLabels)) {
      const bool are_known = std::ranges::all_of(instance.labels, [&](const auto& label) {
        return std::ranges::any_of(written.labels,
                                   [&](const auto& own) { return own.second == label.second; });
      });
      if (instance.labels.empty() || !are_known) differ(who + ": labels");
    }
    if (holds(kHoldsTightBoxes)) {
      const bool is_same =
          written.tight_box.has_value() == instance.tight_box.has_value() &&
          (!written.tight_box || is_near_box(*written.tight_box, *instance.tight_box));
      if (!is_same) differ(who + ": its tight box");
    }
    if (holds(kHoldsPoses)) compare_pose(written, instance);
    if (holds(kHoldsBounds)) {
      const double slack = step(kHoldsBounds) + 1e-5;
      const bool is_same =
          (written.bounds_node.min - instance.bounds_node.min).cwiseAbs().maxCoeff() <= slack &&
          (written.bounds_node.max - instance.bounds_node.max).cwiseAbs().maxCoeff() <= slack;
      if (!is_same) differ(who + ": its bounds");
    }
    compare_visibility(written, instance);
  }

  void compare_pose(const Instance& written, const Instance& instance) {
    Affine expected = written.world_from_node;
    // The world is the camera's space then.
    if (!holds(kHoldsCameraPose)) expected = written_.world_from_camera.inverse() * expected;
    if (!is_near(expected, instance.world_from_node, step(kHoldsPoses))) {
      differ(instance.node_path + ": its pose");
    }
  }

  void compare_visibility(const Instance& written, const Instance& instance) {
    if (!written.visibility || !instance.visibility) return;
    const Visibility& a = *written.visibility;
    const Visibility& b = *instance.visibility;
    if (holds(kHoldsOcclusion)) {
      const auto one = a.occlusion();
      const auto other = b.occlusion();
      const bool is_same = one.has_value() == other.has_value() &&
                           (!one || is_near(*one, *other, 1e-6 + step(kHoldsOcclusion)));
      if (!is_same) differ(instance.node_path + ": its occlusion");
    }
    if (holds(kHoldsTruncation) &&
        !is_near(a.truncation(), b.truncation(), 1e-6 + step(kHoldsTruncation))) {
      differ(instance.node_path + ": its truncation");
    }
    if (holds(kHoldsAmodalBoxes) && a.amodal_box != b.amodal_box) {
      differ(instance.node_path + ": its amodal box");
    }
  }

  const StoredInfo& info_;
  const Frame& written_;
  const Frame& read_;
  std::map<std::uint32_t, const Instance*> partners_;  ///< Written ones, by id that was read.
  std::vector<std::string> differences_;
};

}  // namespace

std::vector<std::string> frame_differences(const StoredInfo& info, const Frame& written,
                                           const Frame& read) {
  return FrameComparison(info, written, read).run();
}

}  // namespace diorama
