// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/frame_checks.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "framework/datasets/check_names.h"
#include "framework/datasets/lens.h"
#include "framework/datasets/object_checks.h"

namespace diorama {
namespace {

constexpr const char* kFinite = "numbers are finite";
constexpr const char* kIds = "ids within the label map";
constexpr const char* kBox = "box = extent of mask";
constexpr const char* kAmodal = "visible <= amodal";
constexpr const char* kOrder = "occlusion order agrees with masks";
constexpr const char* kNormalsFace = "normals face the camera";
constexpr const char* kMotionAgrees = "motion agrees with flow and distances";
constexpr const char* kSame = "an object stays what it is";
constexpr const char* kInImage = "labels lie in the image";
constexpr const char* kLeaves = "surfaces are parts of their objects";
constexpr const char* kCameras = "cameras of one capture agree";
constexpr const char* kOwnPixels = "each capture has pixels of its own";

/// A single wrong pixel is a fault; edges of 8-bit normals are not.
constexpr double kNormalSlack = 0.08;

struct Extent {
  PixelBox box{1 << 30, 1 << 30, 0, 0};
  std::int64_t count = 0;
};

std::map<std::uint32_t, Extent> extents_of(const Image<std::uint32_t>& ids) {
  std::map<std::uint32_t, Extent> result;
  for (int y = 0; y < ids.height(); ++y) {
    Extent* last = nullptr;
    std::uint32_t last_id = 0;
    for (int x = 0; x < ids.width(); ++x) {
      const std::uint32_t id = ids.at(x, y);
      if (!last || id != last_id) {
        last = &result[id];
        last_id = id;
      }
      PixelBox& box = last->box;
      box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, x + 1),
             std::max(box.y_max, y + 1)};
      ++last->count;
    }
  }
  result.erase(0);
  return result;
}

std::string box_text(const PixelBox& box) {
  return "[" + std::to_string(box.x_min) + ", " + std::to_string(box.y_min) + ", " +
         std::to_string(box.x_max) + ", " + std::to_string(box.y_max) + ")";
}

bool is_inside(const PixelBox& inner, const PixelBox& outer, int slack) {
  return inner.x_min >= outer.x_min - slack && inner.y_min >= outer.y_min - slack &&
         inner.x_max <= outer.x_max + slack && inner.y_max <= outer.y_max + slack;
}

/// The checks of one frame.
class FrameChecks {
 public:
  FrameChecks(const StoredInfo& info, StoredCapture& stored, std::size_t place)
      : info_(info), stored_(stored), place_(place), frame_(stored.capture.frames[place]) {
    if (frame_.has(kInstanceId.name)) masks_ = extents_of(frame_.get(kInstanceId));
  }

  void run() {
    if (!check_sizes()) return;
    check_numbers();
    check_poses();
    if (frame_.has(kInstanceId.name)) {
      check_ids();
      if (holds(kHoldsTightBoxes)) check_boxes();
    }
    check_visibility();
    if (holds(kHoldsLeafPaths) && holds(kHoldsNodePaths)) check_leaves();
    if (holds("occlusion_order") && holds("amodal_mask")) check_order();
    if (holds(kHoldsCamera)) check_geometry();
    if (stored_.capture.clip && frame_.has(kMotion.name)) check_motion();
  }

 private:
  bool holds(std::string_view name) const { return info_.holds.contains(name); }

  void check(bool is_good, const char* rule, std::string_view held, const std::string& object,
             const std::string& found, const std::string& expected = {}) {
    ++stored_.log.checks;
    if (is_good) return;
    stored_.log.findings.push_back({rule, file_of(stored_, place_, held), stored_.capture.index,
                                    frame_.camera_name, object, found, expected});
  }

  bool check_sizes() {
    bool is_good = true;
    for (const std::string& name : frame_.channels()) {
      const auto size =
          std::visit([](const auto& image) { return std::pair(image.width(), image.height()); },
                     frame_.image_named(name));
      const bool fits = size == std::pair(frame_.camera.width, frame_.camera.height);
      is_good = is_good && fits;
      check(fits, kCountsAgree, name, "",
            name + " has " + std::to_string(size.first) + " x " + std::to_string(size.second) +
                " pixels",
            "the camera has " + std::to_string(frame_.camera.width) + " x " +
                std::to_string(frame_.camera.height));
    }
    return is_good;
  }

  /// How many pixels of a channel break a rule.
  template <class Pixel, class Rule>
  void check_pixels(const Channel<Pixel>& channel, const char* rule, const char* found,
                    Rule&& is_good) {
    if (!frame_.has(channel.name)) return;
    std::size_t wrong = 0;
    for (const Pixel& pixel : frame_.get(channel).pixels()) {
      if (!is_good(pixel)) ++wrong;
    }
    check(wrong == 0, rule, channel.name, "", std::to_string(wrong) + " values " + found);
  }

  void check_numbers() {
    const auto is_distance = [](float d) { return d > 0.0f; };
    check_pixels(kDistanceToCamera, kFinite, "are no distance above 0", is_distance);
    check_pixels(kDistanceToImagePlane, kFinite, "are no distance above 0", is_distance);
    check_pixels(kSensorDepth, kFinite, "are neither a depth nor 0 for none",
                 [](float z) { return z >= 0.0f && std::isfinite(z); });
    for (const auto& [channel, found] :
         {std::pair(kMotion, "have a motion that is not finite"),
          std::pair(kFlowForward, "have a flow that is not finite"),
          std::pair(kFlowBackward, "have a flow that is not finite")}) {
      check_pixels(channel, kFinite, found, [](const Vec2f& v) { return v.allFinite(); });
    }
    check_pixels(kPosition, kFinite, "have a position that is not finite",
                 [](const Vec3f& v) { return v.allFinite(); });
    check_pixels(kColorHdr, kFinite, "have a radiance that is none",
                 [](const Vec3f& v) { return v.allFinite() && (v.array() >= 0.0f).all(); });
    const double slack = 1e-3 + 2.0 * step_of(info_, kNormals.name);
    check_pixels(kNormals, kFinite, "have a normal that is neither zero nor of length 1",
                 [&](const Vec3f& n) {
                   const double length = double(n.norm());
                   return length <= slack || std::abs(length - 1.0) <= slack;
                 });
  }

  void check_poses() {
    if (holds(kHoldsCameraPose)) {
      check(frame_.world_from_camera.matrix().allFinite(), kFinite, kHoldsCameraPose, "",
            "the camera's pose is not finite");
    }
    if (!holds(kHoldsPoses) && !holds(kHoldsBoxes3d)) return;
    for (const Instance& instance : frame_.instances) {
      check(instance.world_from_node.matrix().allFinite() &&
                (!holds(kHoldsBoxes3d) || instance.bounds_node.is_empty() ||
                 (instance.bounds_node.min.allFinite() && instance.bounds_node.max.allFinite())),
            kFinite, kHoldsPoses, instance.node_path, "its pose or size is not finite");
    }
  }

  void check_ids() {
    std::map<std::uint32_t, int> known;
    for (const Instance& instance : frame_.instances) ++known[instance.id];
    for (const auto& [id, count] : known) {
      check(count == 1, kIds, kHoldsInstances, "",
            std::to_string(count) + " objects have the id " + std::to_string(id));
    }
    for (const auto& [id, extent] : masks_) {
      check(known.contains(id), kIds, kInstanceId.name, "",
            std::to_string(extent.count) + " pixels from " + box_text(extent.box) +
                " have the id " + std::to_string(id) + ", which no object has");
    }
  }

  void check_boxes() {
    const int slack = int(step_of(info_, kHoldsTightBoxes));
    for (const Instance& instance : frame_.instances) {
      const auto mask = masks_.find(instance.id);
      const std::string box = instance.tight_box ? box_text(*instance.tight_box) : "none";
      const std::string extent = mask == masks_.end() ? "nothing" : box_text(mask->second.box);
      const bool has_box = instance.tight_box && !instance.tight_box->is_empty();
      bool is_good = has_box == (mask != masks_.end());
      if (has_box && mask != masks_.end()) {
        is_good = is_inside(*instance.tight_box, mask->second.box, slack) &&
                  is_inside(mask->second.box, *instance.tight_box, slack);
      }
      check(is_good, kBox, kHoldsTightBoxes, instance.node_path, "its box is " + box,
            "its pixels extend over " + extent);
    }
  }

  void check_visibility() {
    for (const Instance& instance : frame_.instances) {
      if (instance.tight_box && instance.visibility && instance.visibility->amodal_box &&
          holds(kHoldsAmodalBoxes)) {
        check(is_inside(*instance.tight_box, *instance.visibility->amodal_box, 0), kAmodal,
              kHoldsAmodalBoxes, instance.node_path,
              "its visible box is " + box_text(*instance.tight_box),
              "inside the whole one, " + box_text(*instance.visibility->amodal_box));
      }
      if (instance.visibility && instance.visibility->amodal_box && holds(kHoldsAmodalBoxes)) {
        const PixelBox image{0, 0, frame_.camera.width, frame_.camera.height};
        check(is_inside(*instance.visibility->amodal_box, image, 0), kInImage, kHoldsAmodalBoxes,
              instance.node_path, "its whole box is " + box_text(*instance.visibility->amodal_box),
              "inside the image, " + box_text(image));
      }
      if (!instance.visibility || !holds(kHoldsOcclusion)) continue;
      const Visibility& seen = *instance.visibility;
      check(seen.visible_pixels >= 0 && seen.visible_pixels <= seen.amodal_pixels, kAmodal,
            kHoldsOcclusion, instance.node_path,
            std::to_string(seen.visible_pixels) + " of its pixels are visible",
            "at most the " + std::to_string(seen.amodal_pixels) + " of the whole object");
      if (seen.amodal_mask.bits.empty() || !frame_.has(kInstanceId.name)) continue;
      std::int64_t beyond = 0;
      const auto& ids = frame_.get(kInstanceId);
      for (int y = 0; y < ids.height(); ++y) {
        for (int x = 0; x < ids.width(); ++x) {
          if (ids.at(x, y) == instance.id && !seen.amodal_mask.covers(x, y)) ++beyond;
        }
      }
      check(beyond == 0, kAmodal, "amodal_mask", instance.node_path,
            std::to_string(beyond) + " visible pixels lie outside its amodal mask");
    }
  }

  /// Whatever is seen of an object is itself or something below it.
  void check_leaves() {
    if (!frame_.has(kLeafId.name) || !frame_.has(kInstanceId.name)) return;
    const auto leaves = frame_.get(kLeafId).pixels();
    const auto ids = frame_.get(kInstanceId).pixels();
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> pairs;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      if (ids[i] != 0) ++pairs[{ids[i], leaves[i]}];
    }
    for (const Instance& instance : frame_.instances) {
      std::size_t foreign = 0;
      for (auto it = pairs.lower_bound({instance.id, 0});
           it != pairs.end() && it->first.first == instance.id; ++it) {
        const auto path = frame_.leaf_paths.find(it->first.second);
        const bool is_part =
            path != frame_.leaf_paths.end() && (path->second == instance.node_path ||
                                                path->second.starts_with(instance.node_path + "/"));
        if (!is_part) foreign += it->second;
      }
      check(foreign == 0, kLeaves, kLeafId.name, instance.node_path,
            std::to_string(foreign) + " of its pixels are of surfaces elsewhere",
            "of itself and what is below it");
    }
  }

  /// Where one is seen and the other's whole mask lies it is in front; in no pixel are both.
  void check_order() {
    if (!frame_.has(kInstanceId.name)) return;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::int64_t> said;
    for (const Occlusion& o : frame_.occlusions) said[{o.front, o.behind}] = o.pixels;
    const auto pixels_said = [&](const Instance& front, const Instance& behind) {
      const auto found = said.find({front.id, behind.id});
      return found == said.end() ? std::int64_t(0) : found->second;
    };
    const auto has_mask = [](const Instance& i) {
      return i.visibility && !i.visibility->amodal_mask.bits.empty();
    };
    for (std::size_t i = 0; i < frame_.instances.size(); ++i) {
      for (std::size_t j = i + 1; j < frame_.instances.size(); ++j) {
        const Instance& a = frame_.instances[i];
        const Instance& b = frame_.instances[j];
        if (!has_mask(a) || !has_mask(b)) continue;
        const auto [shared, a_seen, b_seen] = overlap(a, b);
        const std::int64_t a_front = pixels_said(a, b);
        const std::int64_t b_front = pixels_said(b, a);
        const std::string both = a.node_path + " and " + b.node_path;
        check(a_front >= a_seen && b_front >= b_seen && a_front + b_front <= shared, kOrder,
              "occlusion_order", both,
              "the order says that they are in front of each other in " + std::to_string(a_front) +
                  " and " + std::to_string(b_front) + " pixels",
              "at least " + std::to_string(a_seen) + " and " + std::to_string(b_seen) +
                  ", in all at most " + std::to_string(shared));
      }
    }
  }

  struct Overlap {
    std::int64_t shared = 0;
    std::int64_t a_seen = 0;
    std::int64_t b_seen = 0;
  };
  Overlap overlap(const Instance& a, const Instance& b) const {
    const CoverageMask& m = a.visibility->amodal_mask;
    const CoverageMask& n = b.visibility->amodal_mask;
    const PixelBox box =
        PixelBox{std::max(m.box.x_min, n.box.x_min), std::max(m.box.y_min, n.box.y_min),
                 std::min(m.box.x_max, n.box.x_max), std::min(m.box.y_max, n.box.y_max)}
            .clipped(frame_.camera.width, frame_.camera.height);
    const auto& ids = frame_.get(kInstanceId);
    Overlap result;
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (m.bits[m.index(x, y)] == 0 || n.bits[n.index(x, y)] == 0) continue;
        ++result.shared;
        if (ids.at(x, y) == a.id) ++result.a_seen;
        if (ids.at(x, y) == b.id) ++result.b_seen;
      }
    }
    return result;
  }

  void check_geometry() {
    const lint::Lens lens = lint::lens_of(frame_.camera);
    const Affine camera_from_world = lint::flipped_axes() * frame_.world_from_camera.inverse();
    check_distance_kinds(lens);
    check_normals(lens);
    if (!holds(kHoldsBoxes3d)) return;
    for (const Instance& instance : frame_.instances) {
      if (!instance.world_from_node.matrix().allFinite()) continue;
      if (instance.bounds_node.is_empty()) continue;
      const Affine camera_from_node = camera_from_world * instance.world_from_node;
      check_reprojection(lens, camera_from_node, instance);
      check_depth(lens, camera_from_node, instance, kDistanceToCamera, true);
      check_depth(lens, camera_from_node, instance, kDistanceToImagePlane, false);
    }
  }

  double pose_step() const {
    return std::max(step_of(info_, kHoldsPoses), step_of(info_, kHoldsBoxes3d));
  }

  void check_reprojection(const lint::Lens& lens, const Affine& camera_from_node,
                          const Instance& instance) {
    std::optional<PixelBox> box;
    if (holds(kHoldsTightBoxes)) box = instance.tight_box;
    if (holds(kHoldsAmodalBoxes) && instance.visibility && instance.visibility->amodal_box) {
      box = instance.visibility->amodal_box;
    }
    if (!box || box->is_empty()) return;
    const auto extent = lint::projected_extent(lens, camera_from_node, instance.bounds_node);
    if (!extent) return;
    // Pixel centres lie inside.
    const double depth = std::max((camera_from_node * instance.bounds_node.centre()).z(), 0.05);
    const double slack =
        0.6 + step_of(info_, kHoldsTightBoxes) + 2.0 * pose_step() * lens.focal.maxCoeff() / depth;
    const bool is_good =
        extent->min().x() <= box->x_min + slack && extent->min().y() <= box->y_min + slack &&
        extent->max().x() >= box->x_max - slack && extent->max().y() >= box->y_max - slack;
    check(is_good, lint::kReproject, kHoldsPoses, instance.node_path,
          "its 3-D box projects to x " + std::to_string(extent->min().x()) + " to " +
              std::to_string(extent->max().x()) + ", y " + std::to_string(extent->min().y()) +
              " to " + std::to_string(extent->max().y()),
          "its pixels extend over " + box_text(*box));
  }

  /// The object's surface points lie in its box.
  void check_depth(const lint::Lens& lens, const Affine& camera_from_node, const Instance& instance,
                   const Channel<float>& channel, bool is_along_ray) {
    const auto mask = masks_.find(instance.id);
    if (!frame_.has(channel.name) || mask == masks_.end()) return;
    const auto& depth = frame_.get(channel);
    const auto& ids = frame_.get(kInstanceId);
    const Affine node_from_camera = camera_from_node.inverse();
    const double step =
        (step_of(info_, channel.name) + pose_step()) * node_from_camera.linear().norm();
    const Aabb& bounds = instance.bounds_node;
    const Vec3 slack = 0.002 * bounds.size() + Vec3::Constant(step + 1e-3 * bounds.size().norm());
    std::size_t wrong = 0;
    std::size_t all = 0;
    const PixelBox& box = mask->second.box;
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (ids.at(x, y) != instance.id || !std::isfinite(depth.at(x, y))) continue;
        auto ray = lens.direction(Vec2(x + 0.5, y + 0.5));
        if (!ray) continue;
        *ray /= is_along_ray ? ray->norm() : ray->z();
        const Vec3 p = node_from_camera * (*ray * double(depth.at(x, y)));
        ++all;
        const bool is_in_box = ((p - bounds.min + slack).array() >= 0.0).all() &&
                               ((bounds.max + slack - p).array() >= 0.0).all();
        if (!is_in_box) ++wrong;
      }
    }
    check(wrong == 0, lint::kBackProject, channel.name, instance.node_path,
          std::to_string(wrong) + " of " + std::to_string(all) +
              " surface points lie outside its 3-D box");
  }

  /// The two kinds differ by the angle of the ray.
  void check_distance_kinds(const lint::Lens& lens) {
    if (!frame_.has(kDistanceToCamera.name) || !frame_.has(kDistanceToImagePlane.name)) return;
    const auto& ray = frame_.get(kDistanceToCamera);
    const auto& plane = frame_.get(kDistanceToImagePlane);
    const double step =
        step_of(info_, kDistanceToCamera.name) + step_of(info_, kDistanceToImagePlane.name);
    std::size_t wrong = 0;
    for (int y = 0; y < ray.height(); ++y) {
      for (int x = 0; x < ray.width(); ++x) {
        const double d = double(ray.at(x, y));
        const double z = double(plane.at(x, y));
        const auto direction = lens.direction(Vec2(x + 0.5, y + 0.5));
        if (std::isfinite(d) != std::isfinite(z)) {
          ++wrong;
        } else if (std::isfinite(d) && direction &&
                   std::abs(z - d * direction->normalized().z()) > step + 1e-4 + 1e-4 * d) {
          ++wrong;
        }
      }
    }
    check(wrong == 0, lint::kBackProject, kDistanceToCamera.name, "",
          std::to_string(wrong) +
              " pixels do not agree with distance_to_image_plane and the camera's rays");
  }

  void check_normals(const lint::Lens& lens) {
    if (!frame_.has(kNormals.name) || !holds(kHoldsCameraPose)) return;
    const auto& normals = frame_.get(kNormals);
    const Mat3 world_from_lens =
        (frame_.world_from_camera * lint::flipped_axes().inverse()).linear();
    std::size_t wrong = 0;
    std::size_t all = 0;
    for (int y = 0; y < normals.height(); ++y) {
      for (int x = 0; x < normals.width(); ++x) {
        const Vec3 normal = normals.at(x, y).cast<double>();
        const auto ray = lens.direction(Vec2(x + 0.5, y + 0.5));
        if (!ray || normal.norm() < 0.5) continue;
        ++all;
        if (normal.dot((world_from_lens * *ray).normalized()) > kNormalSlack) ++wrong;
      }
    }
    // Smooth shading may bend a normal away at an outline.
    check(double(wrong) <= 0.02 * double(all), kNormalsFace, kNormals.name, "",
          std::to_string(wrong) + " of " + std::to_string(all) + " normals look away from it");
  }

  /// In a clip: none where nothing was hit and in the first frame, else the flow to the last frame,
  /// turned round.
  void check_motion() {
    constexpr double kSlackPx = 1e-3;
    const auto motion = frame_.get(kMotion).pixels();
    const auto pixels_of = [&]<class Pixel>(const Channel<Pixel>& channel) {
      return frame_.has(channel.name) ? frame_.get(channel).pixels() : std::span<const Pixel>();
    };
    auto distances = pixels_of(kDistanceToCamera);
    if (distances.empty()) distances = pixels_of(kDistanceToImagePlane);
    const auto flow = pixels_of(kFlowBackward);
    const auto states = pixels_of(kFlowBackwardState);
    const bool begins = stored_.capture.clip->frame == 0;
    std::size_t without_surface = 0;
    std::size_t at_the_beginning = 0;
    std::size_t against_flow = 0;
    for (std::size_t i = 0; i < motion.size(); ++i) {
      const bool moves = double(motion[i].norm()) > kSlackPx;
      const bool is_known = states.empty() || states[i] != std::uint32_t(FlowState::Unknown);
      if (!distances.empty() && std::isinf(distances[i])) {
        without_surface += std::size_t(moves);
      } else if (begins) {
        at_the_beginning += std::size_t(moves);
      } else if (!flow.empty() && is_known) {
        against_flow += std::size_t(double((motion[i] + flow[i]).norm()) > kSlackPx);
      }
    }
    const auto check_count = [&](std::size_t wrong, const char* found, const char* expected) {
      check(wrong == 0, kMotionAgrees, kMotion.name, "", std::to_string(wrong) + found, expected);
    };
    check_count(without_surface, " pixels move in which nothing was hit", "none");
    check_count(at_the_beginning, " pixels have moved where a clip begins", "none");
    check_count(against_flow, " pixels have moved otherwise",
                "as flow_backward says, turned round");
  }

  const StoredInfo& info_;
  StoredCapture& stored_;
  std::size_t place_;
  const Frame& frame_;
  std::map<std::uint32_t, Extent> masks_;
};

/// FNV-1a, eight bytes at a time.
std::uint64_t digest(const void* data, std::size_t size,
                     std::uint64_t hash = 0xcbf29ce484222325ull) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (std::size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001b3ull;
  return hash;
}

bool is_uniform(const Image<Rgba8>& image) {
  return image.pixels().empty() || std::ranges::all_of(image.pixels(), [&](const Rgba8& pixel) {
           return pixel == image.pixels()[0];
         });
}

/// Of what the camera saw of which objects.
std::uint64_t label_digest(const Frame& frame) {
  std::uint64_t hash = digest("", 0);
  for (const Instance& instance : frame.instances) {
    if (!instance.tight_box) continue;
    hash = digest(&*instance.tight_box, sizeof *instance.tight_box, hash);
  }
  return hash;
}

}  // namespace

std::string file_of(const StoredCapture& stored, std::size_t frame, std::string_view held) {
  if (frame >= stored.files.size()) return ".";
  const auto& files = stored.files[frame];
  if (const auto found = files.find(held); found != files.end()) return found->second;
  // What has no file of its own stands where the objects do.
  const auto found = files.find(kHoldsInstances);
  return found == files.end() ? "." : found->second;
}

double step_of(const StoredInfo& info, std::string_view held) {
  const auto found = info.steps.find(held);
  return found == info.steps.end() ? 0.0 : found->second;
}

namespace {

/// One object has one name: what cameras call otherwise is not in the same place, of the same size
/// and kind, when neither camera sees both.
void check_names(StoredCapture& stored, double step) {
  const auto is_near = [&](const auto& a, const auto& b) {
    return ((a - b).array().abs() <= step * (1.0 + b.array().abs().maxCoeff())).all();
  };
  const auto is_twin = [&](const Instance& a, const Instance& b) {
    return a.labels == b.labels && !a.bounds_node.is_empty() && !b.bounds_node.is_empty() &&
           is_near(a.world_from_node.matrix(), b.world_from_node.matrix()) &&
           is_near(a.bounds_node.min, b.bounds_node.min) &&
           is_near(a.bounds_node.max, b.bounds_node.max);
  };
  const auto& frames = stored.capture.frames;
  std::vector<std::set<std::string_view>> paths(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    for (const Instance& instance : frames[i].instances) paths[i].insert(instance.node_path);
  }
  for (std::size_t i = 1; i < frames.size(); ++i) {
    for (const Instance& instance : frames[i].instances) {
      if (paths[i - 1].contains(instance.node_path)) continue;
      const auto twin = std::ranges::find_if(frames[i - 1].instances, [&](const Instance& other) {
        return !paths[i].contains(other.node_path) && is_twin(instance, other);
      });
      const bool is_alone = twin == frames[i - 1].instances.end();
      stored.log.check(is_alone,
                       {kCameras, file_of(stored, i, kHoldsNodePaths), stored.capture.index,
                        frames[i].camera_name, instance.node_path, "is another name",
                        is_alone ? "" : twin->node_path + ", by another camera"});
    }
  }
}

/// An object is in one place and of one size and kind, whichever camera sees it.
void check_cameras(const StoredInfo& info, StoredCapture& stored) {
  if (!info.holds.contains(kHoldsNodePaths) || !info.holds.contains(kHoldsCameraPose)) return;
  const double step = std::max({1e-4, step_of(info, kHoldsPoses), step_of(info, kHoldsBounds)});
  const bool has_poses = info.holds.contains(kHoldsPoses);
  const bool has_bounds = info.holds.contains(kHoldsBounds);
  std::map<std::string, const Instance*> known;
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    const Frame& frame = stored.capture.frames[i];
    for (const Instance& instance : frame.instances) {
      const auto [place, is_new] = known.emplace(instance.node_path, &instance);
      if (is_new) continue;
      const Instance& other = *place->second;
      const auto check = [&](bool holds, std::string_view held, const char* found) {
        stored.log.check(
            holds, {kCameras, file_of(stored, i, held), stored.capture.index, frame.camera_name,
                    instance.node_path, found, "as another camera has it"});
      };
      const auto differs = [&](const auto& a, const auto& b) {
        const double size = 1.0 + b.array().abs().maxCoeff();
        return !((a - b).array().abs() <= step * size).all();
      };
      if (has_poses) {
        check(!differs(instance.world_from_node.matrix(), other.world_from_node.matrix()),
              kHoldsPoses, "is in another place");
      }
      const bool has_both = !instance.bounds_node.is_empty() && !other.bounds_node.is_empty();
      if (has_bounds && has_both) {
        check(!differs(instance.bounds_node.min, other.bounds_node.min) &&
                  !differs(instance.bounds_node.max, other.bounds_node.max),
              kHoldsBounds, "has another size");
      }
      if (info.holds.contains(kHoldsLabels)) {
        check(instance.labels == other.labels, kHoldsLabels, "has other labels");
      }
    }
  }
  if (has_poses && has_bounds) check_names(stored, step);
}

}  // namespace

void check_frames(const StoredInfo& info, StoredCapture& stored) {
  check_cameras(info, stored);
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    FrameChecks(info, stored, i).run();
  }
}

void CaptureComparison::add(const StoredCapture& stored, ReadLog& log) {
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    if (info_.holds.contains(kHoldsNodePaths)) compare_objects(stored, i, log);
    if (is_own_ && info_.holds.contains(kHoldsTracks)) compare_tracks(stored, i, log);
    compare_pixels(stored, i, log);
  }
}

void CaptureComparison::compare_objects(const StoredCapture& stored, std::size_t place,
                                        ReadLog& log) {
  const Frame& frame = stored.capture.frames[place];
  for (const Instance& instance : frame.instances) {
    const auto [known, is_new] = objects_.try_emplace(
        instance.node_path, KnownObject{stored.capture.index, instance.labels});
    if (is_new) continue;
    const KnownObject& before = known->second;
    // An environment's nodes may be others in the next visit.
    if (!instance.node_path.starts_with("/Assets/")) continue;
    if (info_.holds.contains(kHoldsLabels)) {
      log.check(instance.labels == before.labels,
                {kSame, file_of(stored, place, kHoldsLabels), stored.capture.index,
                 frame.camera_name, instance.node_path, "has other labels",
                 "those of capture " + std::to_string(before.capture)});
    }
  }
}

void CaptureComparison::compare_tracks(const StoredCapture& stored, std::size_t place,
                                       ReadLog& log) {
  const auto& clip = stored.capture.clip;
  if (!clip || !info_.holds.contains(kHoldsLabels)) return;
  if (std::exchange(clip_, clip->clip) != clip->clip) tracks_.clear();
  const Frame& frame = stored.capture.frames[place];
  for (const Instance& instance : frame.instances) {
    const KnownObject& known =
        tracks_.try_emplace(instance.id, KnownObject{stored.capture.index, instance.labels})
            .first->second;
    log.check(instance.labels == known.labels,
              {kSame, file_of(stored, place, kHoldsLabels), stored.capture.index, frame.camera_name,
               "track " + std::to_string(instance.id), "has other labels",
               "those of capture " + std::to_string(known.capture)});
  }
}

void CaptureComparison::compare_pixels(const StoredCapture& stored, std::size_t place,
                                       ReadLog& log) {
  const Frame& frame = stored.capture.frames[place];
  if (!frame.has(kColor.name) || is_uniform(frame.get(kColor))) return;
  const auto pixels = frame.get(kColor).pixels();
  const std::uint64_t key = digest(pixels.data(), pixels.size_bytes());
  const std::uint64_t labels = label_digest(frame);
  const auto [known, is_new] =
      pictures_.try_emplace(key, KnownPicture{stored.capture.index, labels});
  log.check(
      is_new || known->second.labels == labels,
      {kOwnPixels, file_of(stored, place, kColor.name), stored.capture.index, frame.camera_name, "",
       "has the picture of capture " + std::to_string(known->second.capture),
       "a picture of its own, as the labels differ"});
}

}  // namespace diorama
