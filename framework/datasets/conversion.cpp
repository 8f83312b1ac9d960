// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/conversion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "diorama/error.h"
#include "framework/config/joined.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/check_names.h"
#include "framework/datasets/pixel_boxes.h"

namespace diorama {
namespace {

/// Each of the two kinds of distance follows from the other one and the lens.
std::string_view twin_of(std::string_view channel) {
  if (channel == kDistanceToCamera.name) return kDistanceToImagePlane.name;
  if (channel == kDistanceToImagePlane.name) return kDistanceToCamera.name;
  return {};
}

bool is_derivable(std::string_view channel, const NameSet& holds) {
  return !twin_of(channel).empty() && holds.contains(twin_of(channel)) &&
         holds.contains(kHoldsCamera);
}

void derive_distance(std::string_view channel, Frame& frame) {
  const bool is_plane = channel == kDistanceToImagePlane.name;
  const auto& from = frame.get(is_plane ? kDistanceToCamera : kDistanceToImagePlane);
  Image<float> to(from.width(), from.height(), std::numeric_limits<float>::infinity());
  for (int y = 0; y < from.height(); ++y) {
    for (int x = 0; x < from.width(); ++x) {
      const auto ray = ray_direction(frame.camera, Vec2(x + 0.5, y + 0.5));
      if (!ray || !std::isfinite(from.at(x, y))) continue;
      const double along_axis = -ray->z();
      const double d = double(from.at(x, y));
      to.at(x, y) = float(is_plane ? d * along_axis : d / along_axis);
    }
  }
  frame.set(is_plane ? kDistanceToImagePlane : kDistanceToCamera, std::move(to));
}

/// The visible pixels alone.
CoverageMask visible_mask(const Image<std::uint32_t>& ids, std::uint32_t id, const PixelBox& box) {
  CoverageMask mask;
  mask.box = box;
  mask.bits.reserve(std::size_t(box.width()) * std::size_t(box.height()));
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) mask.bits.push_back(ids.at(x, y) == id ? 1 : 0);
  }
  return mask;
}

/// Boxes that people drew may reach out of the picture.
void clip_boxes(Frame& frame) {
  for (Instance& instance : frame.instances) {
    if (!instance.tight_box) continue;
    const PixelBox inside = instance.tight_box->clipped(frame.camera.width, frame.camera.height);
    if (inside.is_empty()) {
      instance.tight_box.reset();
    } else {
      instance.tight_box = inside;
    }
  }
}

/// Levels are told by counts of which only the shares are true: makes them those of the object's
/// visible pixels, which without masks are those of its box.
void count_levels(Instance& instance, std::optional<std::int64_t> visible) {
  if (!instance.visibility || !instance.tight_box) return;
  const Visibility level = *instance.visibility;
  const double pixels =
      visible ? double(*visible)
              : double(instance.tight_box->width()) * double(instance.tight_box->height());
  // What has a box is seen, however little of it.
  constexpr double kLeastSeen = 1e-3;
  const double inside = pixels / std::max(1.0 - level.occlusion().value_or(0.0), kLeastSeen);
  const double outside = inside * level.truncation() / (1.0 - level.truncation());
  instance.visibility =
      Visibility{std::llround(pixels), std::llround(inside), std::llround(std::ceil(outside)),
                 instance.tight_box,   instance.tight_box,   {}};
}

/// Boxes of pixels, and visibility as if nothing were hidden or cut off, where they are missing.
void complete_instances(Frame& frame, const NameSet& needs, bool tells_levels) {
  clip_boxes(frame);
  const bool has_ids = frame.has(kInstanceId.name);
  if (has_ids) complete_boxes(frame);
  if (!needs.contains("visibility")) return;
  if (!has_ids) {
    if (!tells_levels) return;
    for (Instance& instance : frame.instances) count_levels(instance, std::nullopt);
    return;
  }
  const Image<std::uint32_t>& ids = frame.get(kInstanceId);
  const auto seen = pixel_extents(ids);
  for (Instance& instance : frame.instances) {
    const auto found = seen.find(instance.id);
    const std::int64_t pixels = found == seen.end() ? 0 : found->second.pixels;
    if (tells_levels) count_levels(instance, pixels);
    if (!instance.visibility) {
      instance.visibility.emplace();
      instance.visibility->visible_pixels = instance.visibility->amodal_pixels = pixels;
    }
    Visibility& visibility = *instance.visibility;
    if (pixels == 0) continue;
    if (!visibility.amodal_box) visibility.amodal_box = found->second.box;
    if (!visibility.whole_box) visibility.whole_box = visibility.amodal_box;
    if (needs.contains("amodal_mask") && visibility.amodal_mask.bits.empty()) {
      // Counts and boxes of a whole object that nobody knows the shape of would contradict it.
      const PixelBox& box = found->second.box;
      visibility = {pixels, pixels, 0, box, box, visible_mask(ids, instance.id, box)};
    }
  }
}

/// Where one is seen and another's whole mask lies it is in front of that one. Of pixels where a
/// third hides both nothing is known.
std::vector<Occlusion> order_of_masks(const Frame& frame) {
  std::vector<Occlusion> order;
  if (!frame.has(kInstanceId.name)) return order;
  const Image<std::uint32_t>& ids = frame.get(kInstanceId);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int64_t> pixels;
  for (const Instance& behind : frame.instances) {
    if (!behind.visibility || behind.visibility->amodal_mask.bits.empty()) continue;
    const CoverageMask& mask = behind.visibility->amodal_mask;
    const PixelBox& box = mask.box;
    for (int y = std::max(box.y_min, 0); y < std::min(box.y_max, ids.height()); ++y) {
      for (int x = std::max(box.x_min, 0); x < std::min(box.x_max, ids.width()); ++x) {
        const std::uint32_t front = ids.at(x, y);
        if (front == 0 || front == behind.id || mask.bits[mask.index(x, y)] == 0) continue;
        ++pixels[{front, behind.id}];
      }
    }
  }
  for (const Instance& front : frame.instances) {
    for (const Instance& behind : frame.instances) {
      const auto found = pixels.find({front.id, behind.id});
      if (found != pixels.end()) order.push_back({front.id, behind.id, found->second});
    }
  }
  return order;
}

/// Paths that a reader made up say that objects of different pictures are one.
void name_by_picture(Capture& capture) {
  for (Frame& frame : capture.frames) {
    const std::string front =
        "/Assets/" + std::to_string(capture.index) + "_" + frame.camera_name + "_";
    for (Instance& instance : frame.instances) {
      instance.node_path = front + std::to_string(instance.id);
    }
  }
}

/// Writers of clips take an object's id for its number in all frames. Where readers count anew in
/// each frame, objects are told apart by their paths.
class ClipNumbers {
 public:
  void renumber(Capture& capture) {
    if (!capture.clip) return;
    if (capture.clip->frame == 0) numbers_.clear();
    for (Frame& frame : capture.frames) renumber(frame);
  }

 private:
  void renumber(Frame& frame) {
    std::map<std::uint32_t, std::uint32_t> number_of_id{{0, 0}};
    for (Instance& instance : frame.instances) {
      const std::uint32_t number = number_of(instance.node_path);
      number_of_id.emplace(instance.id, number);
      instance.id = number;
    }
    const auto renumbered = [&](std::uint32_t id) {
      const auto [found, is_new] = number_of_id.emplace(id, 0);
      // Nobody lists it: it stays something of its own.
      if (is_new) found->second = number_of("id " + std::to_string(id));
      return found->second;
    };
    for (Occlusion& occlusion : frame.occlusions) {
      occlusion.front = renumbered(occlusion.front);
      occlusion.behind = renumbered(occlusion.behind);
    }
    if (!frame.has(kInstanceId.name)) return;
    Image<std::uint32_t> ids = frame.get(kInstanceId);
    for (std::uint32_t& id : ids.pixels()) {
      if (id != 0) id = renumbered(id);
    }
    frame.set(kInstanceId, std::move(ids));
  }

  std::uint32_t number_of(const std::string& path) {
    return numbers_.emplace(path, std::uint32_t(numbers_.size() + 1)).first->second;
  }

  std::map<std::string, std::uint32_t> numbers_;  ///< By path, in one clip.
};

std::string source_name(const ConversionSource& source) {
  return source.folder.string() + " (" + source.data->info().format + ")";
}

/// What the source tells in place of shares of what is hidden and what is cut off: levels of both,
/// or one share of both.
NameSet told_levels(const ConversionSource& source) {
  NameSet levels;
  if (source.holds.contains(kHoldsOcclusion)) return levels;
  for (const char* level : {kAskOcclusionLevels, kAskTruncationLevels, kAskSeenShares}) {
    if (source.data->info().steps.contains(std::string_view(level))) levels.emplace(level);
  }
  return levels;
}

/// One picture of ids of masks that overlap: a pixel is the smallest object's, which is likely to
/// be a part of the others or to lie on them. Boxes become those of the pixels that are left.
/// Returns how many objects have none.
std::int64_t paint_masks(const std::map<std::uint32_t, CoverageMask>& masks, Frame& frame) {
  std::vector<std::pair<std::int64_t, std::uint32_t>> by_size;
  for (const auto& [id, mask] : masks) {
    by_size.emplace_back(std::ranges::count(mask.bits, std::uint8_t(1)), id);
  }
  std::ranges::sort(by_size, std::greater());
  Image<std::uint32_t> ids(frame.camera.width, frame.camera.height, 0);
  for (const auto& [size, id] : by_size) {
    const CoverageMask& mask = masks.at(id);
    const PixelBox box = mask.box.clipped(ids.width(), ids.height());
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (mask.bits[mask.index(x, y)] != 0) ids.at(x, y) = id;
      }
    }
  }
  const auto seen = pixel_extents(ids);
  for (Instance& instance : frame.instances) {
    const auto found = seen.find(instance.id);
    instance.tight_box.reset();
    if (found != seen.end()) instance.tight_box = found->second.box;
    if (instance.visibility) {
      instance.visibility->visible_pixels = found == seen.end() ? 0 : found->second.pixels;
    }
  }
  frame.set(kInstanceId, std::move(ids));
  return std::ranges::count_if(
      by_size, [&](const auto& each) { return each.first > 0 && !seen.contains(each.second); });
}

/// What a capture lacks of ids of pixels although its files are whole.
struct IdGap {
  int capture = 0;
  bool has_overlaps = false;  ///< Of masks that all objects have.
  bool lacks_masks = false;
  std::int64_t vanishing = 0;  ///< Objects that smaller ones cover.
};

IdGap find_gap(StoredCapture stored) {
  IdGap gap;
  gap.capture = stored.capture.index;
  const bool is_damaged = std::ranges::any_of(stored.log.findings, [](const Finding& finding) {
    return finding.check == kNothingIsMissing || finding.check == kFilesCanBeRead;
  });
  if (is_damaged) return gap;
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    Frame& frame = stored.capture.frames[i];
    if (frame.has(kInstanceId.name)) continue;
    const bool have_all =
        i < stored.masks.size() && std::ranges::all_of(frame.instances, [&](const Instance& each) {
          return stored.masks[i].contains(each.id);
        });
    (have_all ? gap.has_overlaps : gap.lacks_masks) = true;
    if (have_all) gap.vanishing += paint_masks(stored.masks[i], frame);
  }
  return gap;
}

/// "3 of 20 captures, first in capture 7".
class CapturesFound {
 public:
  void add(int capture) {
    if (count_++ == 0) first_ = capture;
  }
  std::size_t count() const { return count_; }
  std::string text(std::size_t all) const {
    return std::to_string(count_) + " of " + std::to_string(all) + " captures, first in capture " +
           std::to_string(first_);
  }

 private:
  std::size_t count_ = 0;
  int first_ = 0;
};

}  // namespace

void look_through(ConversionSource& source, const NameSet& needs, Host& host) {
  const StoredDataset& data = *source.data;
  source.holds = data.info().holds;
  // What a job made has a picture of ids; visibility that is not held is counted in it.
  const bool uses_ids = needs.contains(kInstanceId.name) || needs.contains("visibility");
  if (!uses_ids || !source.holds.contains(kInstanceId.name) || !source.info.resolved_job.empty()) {
    return;
  }
  CapturesFound lacking;
  CapturesFound overlapping;
  std::int64_t vanishing = 0;
  sweep_captures<IdGap>(data, NameSet{std::string(kInstanceId.name)}, host, find_gap,
                        [&](const IdGap& gap) {
                          if (gap.lacks_masks) lacking.add(gap.capture);
                          if (gap.has_overlaps) overlapping.add(gap.capture);
                          vanishing += gap.vanishing;
                        });
  const std::size_t all = data.info().captures.size();
  if (lacking.count() > 0) {
    source.holds.erase(std::string(kInstanceId.name));
    source.why_no_ids = "an object has no mask in " + lacking.text(all);
  } else if (overlapping.count() > 0) {
    source.overlaps = "masks overlap in " + overlapping.text(all) +
                      "; a pixel of several objects becomes the smallest one's, of which " +
                      std::to_string(vanishing) + " objects lose all pixels";
  }
}

NameSet lacking_channels(const ConversionSource& source, const NameSet& needs) {
  NameSet missing;
  for (const std::string& name : needs) {
    if (is_annotation(name) || source.holds.contains(name)) continue;
    if (!is_derivable(name, source.holds)) missing.insert(name);
  }
  return missing;
}

Conversion::Conversion(std::vector<ConversionSource> sources, NameSet needs)
    : sources_(std::move(sources)), needs_(std::move(needs)) {
  for (const ConversionSource& source : sources_) {
    if (source.data->info().captures.empty()) {
      throw Error(ErrorKind::Usage, source_name(source) + ": holds no capture");
    }
    note_differences(source);
  }
  for (ConversionSource& source : sources_) note_clips(source);
  unite_infos();
}

void Conversion::note_differences(const ConversionSource& source) {
  const NameSet& holds = source.holds;
  NameSet missing = lacking_channels(source, needs_);
  NameSet derived;
  NameSet made_up;
  const auto is_annotation_held = [&](std::string_view name) {
    return holds.contains(name == "visibility" ? kHoldsOcclusion : name);
  };
  for (const std::string& name : needs_) {
    if (is_annotation(name)) {
      if (!is_annotation_held(name)) made_up.insert(name);
    } else if (!holds.contains(name) && !missing.contains(name)) {
      derived.insert(name);
    }
  }
  if (!missing.empty() || made_up.contains("instances")) {
    if (made_up.contains("instances")) missing.emplace("instances");
    const std::string why = missing.contains(kInstanceId.name) && !source.why_no_ids.empty()
                                ? " (" + source.why_no_ids + ")"
                                : "";
    throw Error(ErrorKind::Usage, source_name(source) + ": does not hold " + joined(missing) + why +
                                      ", which the writers need; it holds " + joined(holds));
  }
  const std::string who = source_name(source);
  if (!source.why_no_ids.empty()) {
    notes_.push_back(who + ": " + source.why_no_ids + "; no writer gets a mask");
  }
  if (!source.overlaps.empty() && needs_.contains(kInstanceId.name)) {
    notes_.push_back(who + ": " + source.overlaps);
  }
  if (!derived.empty()) {
    notes_.push_back(who + ": " + joined(derived) + " comes from the other kind of distance");
  }
  if (made_up.erase("occlusion_order") > 0) {
    notes_.push_back(who + ": does not hold occlusion_order; " +
                     (holds.contains("amodal_mask")
                          ? "lists of what hides an object are those of the masks, without pixels "
                            "where a third hides both"
                          : "lists of what hides an object are empty, whatever is hidden"));
  }
  const NameSet told = told_levels(source);
  if (!told.empty() && made_up.erase("visibility") > 0) {
    notes_.push_back(
        who + (told.contains(std::string_view(kAskSeenShares))
                   ? ": holds what share of an object is seen, but not whether the rest is hidden "
                     "or cut off; it counts as hidden"
                   : ": holds levels of what is hidden or cut off, no shares; where a format says "
                     "shares, objects have that in the middle of their level"));
  }
  if (!made_up.empty()) {
    notes_.push_back(who + ": does not hold " + joined(made_up) + "; objects count as neither " +
                     "hidden nor cut off" +
                     (holds.contains(kInstanceId.name)
                          ? ""
                          : ", where a format cannot say that it is not known"));
  }
  const auto step = source.data->info().steps.find(kHoldsTightBoxes);
  const bool has_drawn_boxes = step != source.data->info().steps.end() && step->second > 0.0 &&
                               holds.contains(kHoldsTightBoxes);
  if (has_drawn_boxes && needs_.contains("instances")) {
    notes_.push_back(who +
                     ": boxes are those of whole pixels inside the picture; others are rounded "
                     "and cut off");
  }
  NameSet unknown;
  for (const std::string_view name : {kHoldsLabels, kHoldsPoses, kHoldsBounds, kHoldsCamera,
                                      kHoldsCameraPose, kHoldsTruncation}) {
    if (!holds.contains(name)) unknown.emplace(name);
  }
  if (holds.contains(kHoldsBoxes3d)) {
    unknown.erase(std::string(kHoldsPoses));
    unknown.erase(std::string(kHoldsBounds));
  }
  if (!unknown.empty()) {
    notes_.push_back(who + ": does not hold " + joined(unknown) +
                     "; where writers write these, they mean nothing");
  }
  NameSet left;
  for (const std::string& name : holds) {
    const bool is_channel = name == kInstanceId.name || name == kLeafId.name ||
                            name.starts_with("distance_") || name == kNormals.name ||
                            name == kMotion.name || name.starts_with("flow_") ||
                            name == kColorHdr.name || name == kSensorDepth.name ||
                            name == "pointcloud" || is_annotation(name);
    if (is_channel && !needs_.contains(name)) left.insert(name);
  }
  if (!left.empty()) notes_.push_back(who + ": no writer takes " + joined(left));
}

/// Frames of a clip are one only if its objects are known again.
void Conversion::note_clips(ConversionSource& source) {
  const NameSet& holds = source.holds;
  const bool are_known = holds.contains(kHoldsTracks) || holds.contains(kHoldsNodePaths);
  if (source.info.clips.empty() || are_known || !needs_.contains("instances")) return;
  source.info.clips.clear();
  notes_.push_back(source_name(source) +
                   ": does not hold which objects of a clip's frames are the same; frames of clips "
                   "become captures of their own");
}

void Conversion::unite_infos() {
  info_ = sources_.front().info;
  if (sources_.size() == 1) return;
  info_.capture_count = 0;
  info_.camera_names.clear();
  info_.classes.clear();
  info_.resolved_job.clear();
  info_.validation.reset();
  info_.clips.clear();
  std::set<Labels> labels;
  std::map<std::string, DatasetAsset> assets;
  const bool have_classes = std::ranges::all_of(
      sources_, [](const ConversionSource& source) { return !source.info.classes.empty(); });
  for (const ConversionSource& source : sources_) {
    const DatasetInfo& each = source.info;
    for (const std::string& camera : each.camera_names) {
      if (std::ranges::find(info_.camera_names, camera) == info_.camera_names.end()) {
        info_.camera_names.push_back(camera);
      }
    }
    for (const std::string& name : each.classes) {
      if (have_classes && std::ranges::find(info_.classes, name) == info_.classes.end()) {
        info_.classes.push_back(name);
      }
      if (!have_classes) labels.insert(Labels{{"class", name}});
    }
    labels.insert(each.labels.begin(), each.labels.end());
    for (const DatasetAsset& asset : each.assets) assets.emplace(asset.asset, asset);
    if (each.validation) {
      if (!info_.validation) info_.validation.emplace();
      for (const int capture : *each.validation) {
        info_.validation->push_back(info_.capture_count + capture);
      }
    }
    for (DatasetClip clip : each.clips) {
      clip.first += info_.capture_count;
      info_.clips.push_back(clip);
    }
    info_.capture_count += each.capture_count;
  }
  info_.labels.assign(labels.begin(), labels.end());
  info_.assets.clear();
  for (auto& [name, asset] : assets) info_.assets.push_back(std::move(asset));
}

void Conversion::run(Host& host, const std::function<void(Capture)>& take) const {
  int number = 0;
  for (const ConversionSource& source : sources_) {
    NameSet wanted = source.holds;
    for (const auto* channel : {&kDistanceToCamera, &kDistanceToImagePlane}) {
      const bool is_used =
          needs_.contains(channel->name) || needs_.contains(twin_of(channel->name));
      if (!is_used) wanted.erase(std::string(channel->name));
    }
    for (const std::string_view name :
         {kNormals.name, kMotion.name, kFlowForward.name, kFlowForwardState.name,
          kFlowBackward.name, kFlowBackwardState.name, kColorHdr.name, kSensorDepth.name,
          std::string_view("pointcloud")}) {
      if (!needs_.contains(name)) wanted.erase(std::string(name));
    }
    if (needs_.contains("visibility")) wanted.merge(told_levels(source));
    const NameSet& holds = source.holds;
    const bool counts_anew = !holds.contains(kHoldsTracks);
    const bool has_paths = holds.contains(kHoldsNodePaths) || !counts_anew;
    ClipNumbers numbers;
    sweep_captures<Capture>(
        *source.data, wanted, host,
        [&](StoredCapture stored) { return converted(source, std::move(stored)); },
        [&](Capture capture) {
          capture.index = number++;
          capture.clip = clip_frame(info_.clips, capture.index);
          if (!has_paths) name_by_picture(capture);
          if (counts_anew) numbers.renumber(capture);
          take(std::move(capture));
        });
  }
}

Capture Conversion::converted(const ConversionSource& source, StoredCapture stored) const {
  for (const std::string& camera : source.data->info().camera_names) {
    const bool is_there = std::ranges::any_of(
        stored.capture.frames, [&](const Frame& frame) { return frame.camera_name == camera; });
    if (!is_there) refuse_capture(source.folder, stored, camera);
  }
  for (std::size_t i = 0; i < stored.capture.frames.size(); ++i) {
    Frame& frame = stored.capture.frames[i];
    const bool has_overlaps = !source.overlaps.empty() && !frame.has(kInstanceId.name) &&
                              needs_.contains(kInstanceId.name) && i < stored.masks.size();
    if (has_overlaps && !stored.masks[i].empty()) paint_masks(stored.masks[i], frame);
    for (const std::string& name : needs_) {
      if (is_annotation(name) || frame.has(name)) continue;
      const std::string_view twin = twin_of(name);
      const bool can_derive = !twin.empty() && frame.has(twin);
      if (!can_derive) refuse_capture(source.folder, stored, frame.camera_name, name);
      derive_distance(name, frame);
    }
    if (frame.camera_path.empty()) frame.camera_path = "/Cameras/" + frame.camera_name;
    if (needs_.contains("instances")) {
      complete_instances(frame, needs_, !told_levels(source).empty());
    }
    if (needs_.contains("occlusion_order") && !source.holds.contains("occlusion_order")) {
      frame.occlusions = order_of_masks(frame);
    }
    // What means nothing is a point, a number that every format can write; empty boxes are
    // infinite.
    for (Instance& instance : frame.instances) {
      if (instance.bounds_node.is_empty()) instance.bounds_node.add(Vec3::Zero());
    }
  }
  return std::move(stored.capture);
}

void refuse_capture(const std::filesystem::path& folder, const StoredCapture& stored,
                    const std::string& camera, const std::string& lacking) {
  const Finding* reason = nullptr;
  for (const Finding& finding : stored.log.findings) {
    const bool is_missing = finding.check == kNothingIsMissing;
    if (!finding.camera.empty() && !camera.empty() && finding.camera != camera) continue;
    if (!reason || (reason->check == kNothingIsMissing && !is_missing)) reason = &finding;
  }
  const std::string where = (reason ? folder / reason->file : folder).string();
  const std::string none =
      "does not hold " + (lacking.empty() ? "what its dataset holds" : lacking) +
      (lacking == kInstanceId.name ? ": masks overlap, or an object has none" : "");
  throw Error(ErrorKind::Asset, where + ": " + (reason ? reason->found : none) + " (capture " +
                                    std::to_string(stored.capture.index) +
                                    (camera.empty() ? "" : ", " + camera) + ")");
}

}  // namespace diorama
