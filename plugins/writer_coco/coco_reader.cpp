// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_reader.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include <span>
#include "diorama/error.h"
#include "reader_support/asked_levels.h"
#include "reader_support/camera_json.h"
#include "reader_support/capture_rows.h"
#include "reader_support/clip_list.h"
#include "reader_support/frame_reading.h"
#include "reader_support/listed_boxes.h"
#include "reader_support/object_masks.h"
#include "writer_coco/coco_categories.h"
#include "writer_coco/coco_tables.h"
#include "writer_support/cuboid.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "COCO";
constexpr const char* kArea = "area = count";
constexpr const char* kPanoptic = "panoptic segments agree with annotations";
constexpr const char* kKeypoints = "keypoints project onto their pixels";
/// Pixels that the middle of a box may lie beside the line of two corners.
constexpr double kLineSlack = 0.05;
constexpr const char* kReproject = "pose and camera reproject onto the mask";

bool is_whole(const Json& bbox) {
  return std::ranges::all_of(bbox, [](const Json& v) {
    return v.is_number() && v.get<double>() == std::floor(v.get<double>());
  });
}

std::vector<std::vector<Vec2>> polygons_of(const Json& lists) {
  std::vector<std::vector<Vec2>> polygons;
  for (const Json& list : lists) {
    std::vector<Vec2> polygon;
    for (std::size_t i = 0; i + 1 < list.size(); i += 2) {
      polygon.emplace_back(list.at(i).get<double>(), list.at(i + 1).get<double>());
      if (!polygon.back().allFinite()) throw std::runtime_error("a polygon's point is not finite");
    }
    polygons.push_back(std::move(polygon));
  }
  return polygons;
}

class CocoDataset final : public StoredDataset {
 public:
  CocoDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    tables_ = read_coco_tables(folder_, page_, files);
    log_.files += tables_.parts.size();
    check_against_page(files);
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  /// What our own writer always leaves.
  void check_against_page(StoredFiles& files) {
    if (!page_) return;
    const auto categories = files.json("categories.json");
    std::map<std::string, std::size_t> planned;
    for (const auto& [capture, split] : page_->split_of_capture) {
      planned[split] += page_->cameras.size();
    }
    for (const auto& [split, count] : planned) {
      const auto part = std::ranges::find(tables_.parts, split, &CocoPart::split);
      files.check(part != tables_.parts.end(), kMissing, "annotations/instances_" + split + ".json",
                  "", "the file is not there");
      if (part == tables_.parts.end()) continue;
      const auto number = part - tables_.parts.begin();
      const auto listed = std::ranges::count_if(tables_.images, [&](const CocoImageEntry& image) {
        return std::ptrdiff_t(image.part) == number;
      });
      files.check(std::size_t(listed) == count, kCounts, part->file, "",
                  "lists " + std::to_string(listed) + " images",
                  "dataset.json plans " + std::to_string(count));
      if (categories) check_categories(files, *categories, *part);
    }
    for (const CocoPart& part : tables_.parts) {
      const bool has_any =
          std::ranges::any_of(tables_.parts, [](const auto& p) { return !p.panoptic.empty(); });
      const bool has_folder = fs::is_directory(folder_ / "panoptic");
      files.check(!part.panoptic.empty() || !(has_any || has_folder), kMissing,
                  "annotations/panoptic_" + part.split + ".json", "", "the file is not there");
    }
    for (const CocoImageEntry& image : tables_.images) {
      const auto split = page_->split_of_capture.find(image.capture);
      const std::string& own = tables_.parts[image.part].split;
      files.check(split != page_->split_of_capture.end() && split->second == own, kCounts,
                  tables_.parts[image.part].file, "image " + std::to_string(image.id),
                  "is of capture " + std::to_string(image.capture),
                  "which dataset.json does not put into '" + own + "'");
    }
  }

  static void check_categories(StoredFiles& files, const Json& list, const CocoPart& part) {
    files.reading("categories.json", [&] {
      bool is_same = list.size() == part.categories.size();
      for (const Json& category : list) {
        const auto found = part.categories.find(whole_number<std::int64_t>(category.at("id")));
        is_same = is_same && found != part.categories.end() &&
                  found->second.name == category.at("name").get<std::string>();
      }
      files.check(is_same, kIds, part.file, "", "its categories are not those of categories.json");
    });
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = tables_.cameras;
    // Categories of the job's own choice may be called otherwise than the labels.
    info_.classes = page_ && tables_.has_own_categories ? page_->classes : tables_.classes;
    for (const CocoImageEntry& image : tables_.images) {
      if (info_.captures.empty() || info_.captures.back() != image.capture) {
        info_.captures.push_back(image.capture);
        first_image_.push_back(std::size_t(&image - tables_.images.data()));
      }
    }
    first_image_.push_back(tables_.images.size());
    info_.holds = {std::string(kColor.name), std::string(kHoldsInstances),
                   std::string(kHoldsLabels), std::string(kHoldsTightBoxes)};
    const auto hold = [&](bool is_held, std::initializer_list<std::string_view> names) {
      if (is_held) info_.holds.insert(names.begin(), names.end());
    };
    hold(tables_.has_masks, {kInstanceId.name});
    hold(tables_.has_nodes, {kHoldsNodePaths});
    hold(tables_.has_cameras, {kHoldsCamera, kHoldsCameraPose});
    hold(tables_.has_amodal,
         {"amodal_mask", "occlusion_order", kHoldsOcclusion, kHoldsTruncation, kHoldsAmodalBoxes});
    hold(tables_.has_keypoints, {kHoldsKeypoints});
    hold(tables_.has_tracks, {kHoldsTracks});
    for (const CocoPart& part : tables_.parts) {
      for (const auto& [id, category] : part.categories) {
        if (category.keypoint_count > 0) info_.skeletons.emplace(category.name, category.skeleton);
      }
    }
    note_clips(clips_of(page_), info_);
    // Boxes that people drew, and polygons, do not end at pixels.
    info_.steps[std::string(kHoldsTightBoxes)] = page_ ? 0.0 : 2.0;
    info_.steps[std::string(kHoldsTruncation)] = 1e-6;
    if (tables_.has_lossy_pictures) info_.steps[std::string(kColor.name)] = 16.0;
  }

  /// The file of a picture, as COCO folders have it; the likeliest name when there is none. Names
  /// of others may be those that the file had on their disk.
  std::string picture_file(const CocoPart& part, const std::string& name) const {
    const std::string beside = fs::path(part.file).parent_path().generic_string();
    std::vector<std::string> folders;
    if (!part.split.empty()) {
      folders = {"images/" + part.split + "/", part.split + "/", "images/" + part.split + "2017/"};
    }
    folders.insert(folders.end(), {"images/", "", "data/"});
    if (!beside.empty()) folders.push_back(beside + "/");
    const fs::path path(name);
    const bool leads_out = path.is_absolute() || std::ranges::find(path, "..") != path.end();
    std::vector<std::string> places;
    if (!leads_out) places.push_back(name);
    if (!page_) std::ranges::copy(possible_places(name), std::back_inserter(places));
    std::error_code ignored;
    for (const std::string& place : places) {
      for (const std::string& at : folders) {
        if (fs::is_regular_file(folder_ / (at + place), ignored)) return at + place;
      }
    }
    if (leads_out) {
      throw std::runtime_error("the picture '" + name + "' lies outside of the dataset");
    }
    return folders.front() + name;
  }

  friend class CocoImageReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  CocoTables tables_;
  std::vector<std::size_t> first_image_;  ///< Per capture, and one behind the last.
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one image.
class CocoImageReading : private FrameReading {
 public:
  CocoImageReading(const CocoDataset& dataset, const CocoImageEntry& entry, const NameSet& wanted,
                   ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, entry.capture,
                     dataset.tables_.cameras[entry.camera], wanted, log),
        dataset_(dataset),
        part_(dataset.tables_.parts[entry.part]),
        entry_(entry) {}

  /// Nothing when not even the image's size can be known.
  std::optional<Frame> read(FrameSources& sources) {
    bool has_size = false;
    files_.reading(part_.file, [&] {
      image_ = parse_stored_json(read_span(dataset_.folder_ / part_.file, entry_.span));
      frame_.camera.width = whole_number<int>(image_.at("width"));
      frame_.camera.height = whole_number<int>(image_.at("height"));
      const std::int64_t pixels = std::int64_t(frame_.camera.width) * frame_.camera.height;
      if (frame_.camera.width <= 0 || frame_.camera.height <= 0 || pixels > kMostPixels) {
        throw std::runtime_error("image " + std::to_string(entry_.id) +
                                 ": its width and height are none");
      }
      has_size = true;
    });
    if (!has_size) return std::nullopt;
    if (dataset_.tables_.has_cameras) files_.reading(part_.file, [&] { read_camera(); });
    files_.reading(part_.file, [&] { check_clip(); });
    read_picture(sources);
    read_annotations();
    finish(sources);
    if (entry_.panoptic.length > 0 && wanted_.contains(kInstanceId.name)) read_panoptic();
    return std::move(frame_);
  }

  /// By id of the object; what read() has found.
  std::map<std::uint32_t, std::vector<StoredKeypoint>> take_keypoints() {
    return std::move(keypoints_);
  }
  /// By id of the object; see StoredCapture::masks.
  std::map<std::uint32_t, CoverageMask> take_masks() { return std::move(lone_masks_); }

 private:
  void read_camera() {
    Camera& camera = frame_.camera;
    const Json& numbers = image_.at("intrinsics");
    camera.fx = numbers.at(0).get<double>();
    camera.fy = numbers.at(1).get<double>();
    camera.cx = numbers.at(2).get<double>();
    camera.cy = numbers.at(3).get<double>();
    require_usable(camera);
    read_lens_entry(image_, camera);
    if (image_.at("world_from_camera").size() != 4) {
      throw std::runtime_error("world_from_camera has not four rows");
    }
    const Affine world_from_camera = affine_of_rows(image_.at("world_from_camera"));
    require_rigid(world_from_camera, "world_from_camera");
    frame_.world_from_camera = world_from_camera;
  }

  /// Our writer says of a picture which frame of which clip and video it is; videos count from 1,
  /// by clip and camera.
  void check_clip() {
    if (!dataset_.page_) return;
    const auto& clips = dataset_.page_->clips;
    const std::string who = "image " + std::to_string(entry_.id);
    check_clip_frame(image_, clips, entry_.capture, files_, part_.file, who);
    const auto clip = clip_frame(clips, entry_.capture);
    const auto cameras = std::int64_t(dataset_.tables_.cameras.size());
    const Json expected = clip ? Json(clip->clip * cameras + entry_.camera + 1) : Json();
    const Json video = image_.value("video_id", Json());
    files_.check(video == expected, kCounts, part_.file, who, "its video is " + video.dump(),
                 expected.dump() + ", as dataset.json says");
  }

  void read_picture(FrameSources& sources) {
    if (!wanted_.contains(kColor.name)) return;
    files_.reading(part_.file, [&] {
      const std::string file =
          dataset_.picture_file(part_, image_.at("file_name").get<std::string>());
      const auto picture =
          files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, part_.file);
      if (!picture) return;
      frame_.set(kColor, picture->color());
      sources.emplace(kColor.name, file);
    });
  }

  void read_annotations() {
    const auto wants = [&](std::string_view name) { return wanted_.contains(name); };
    const bool wants_masks =
        wants(kInstanceId.name) || wants("amodal_mask") || wants("occlusion_order");
    for (std::uint32_t i = 0; i < entry_.annotation_count; ++i) {
      files_.reading(part_.file, [&] {
        const JsonSpan span = dataset_.tables_.annotations[entry_.first_annotation + i];
        const Json json = parse_stored_json(read_span(dataset_.folder_ / part_.file, span));
        add_instance(json, i + 1, wants_masks);
      });
    }
  }

  void add_instance(const Json& json, std::uint32_t id, bool wants_masks) {
    Instance instance;
    instance.id = id;
    const std::string who =
        "annotation " + (json.contains("id") ? json.at("id").dump() : std::to_string(id));
    instance.node_path = json.contains("node") ? json.at("node").get<std::string>()
                                               : "/Assets/" + std::to_string(id);
    const auto category = part_.categories.find(whole_number<std::int64_t>(json.at("category_id")));
    files_.check(category != part_.categories.end(), kIds, part_.file, who,
                 "has the unknown category " + json.at("category_id").dump());
    if (category != part_.categories.end()) instance.labels["class"] = category->second.name;
    const auto track = json.find("track_id");
    const bool has_page = dataset_.page_.has_value();
    if (track != json.end() && (has_page || track->is_number_unsigned())) {
      // Others may count tracks from 0, which is no id, or have none where they write -1 or null.
      instance.id = whole_number<std::uint32_t>(*track) + (has_page ? 0 : 1);
      const bool is_again =
          std::ranges::find(frame_.instances, instance.id, &Instance::id) != frame_.instances.end();
      files_.check(instance.id > 0 && !is_again, kOnce, part_.file, who,
                   "its track " + track->dump() + " is in the picture twice, or 0");
      if (instance.id == 0 || is_again) return;
    }
    instance.tight_box = box_of_json(json.at("bbox"));
    check_box_inside(who, *instance.tight_box);
    CoverageMask mask;
    if (wants_masks && json.contains("segmentation")) {
      mask = read_mask(json, who);
      read_amodal(json, who, mask, instance);
    } else if (wanted_.contains(kHoldsOcclusion) || wanted_.contains(kHoldsTruncation) ||
               wanted_.contains(kHoldsAmodalBoxes)) {
      read_shares(json, instance);
    }
    if (category != part_.categories.end()) {
      read_keypoints(json, who, category->second, instance.id);
    }
    check_crowd(json, part_.file, who, crowd_below_px());
    if (is_group(json)) instance.labels[kCrowdLabel] = "1";
    whos_.push_back(who);
    categories_.push_back(whole_number<std::int64_t>(json.at("category_id")));
    masks_.push_back(std::move(mask));
    has_mask_.push_back(json.contains("segmentation") && !json.at("segmentation").empty());
    frame_.instances.push_back(std::move(instance));
  }

  /// The crowds of our writer are objects of few pixels, where it was asked for them.
  std::int64_t crowd_below_px() const {
    if (!dataset_.page_) return 0;
    const auto below = dataset_.page_->conventions.find("crowd_below_px");
    const bool is_there = below != dataset_.page_->conventions.end() && below->is_number_integer();
    return is_there ? below->get<std::int64_t>() : 0;
  }

  bool can_have_groups() const { return !dataset_.page_ || !dataset_.page_->is_rendered; }

  /// Said to be a crowd, and not for its few pixels.
  bool is_group(const Json& json) const {
    if (!can_have_groups() || json.value("iscrowd", Json(0)) != 1) return false;
    const std::int64_t below_px = crowd_below_px();
    return below_px == 0 || json.at("area").get<double>() >= double(below_px);
  }

  /// `below_px`: see crowd_below_px(); 0 where there are none. Datasets that were converted have
  /// the crowds of their sources, too.
  void check_crowd(const Json& json, const std::string& file, const std::string& who,
                   std::int64_t below_px) {
    const auto crowd = json.find("iscrowd");
    if (crowd == json.end()) return;
    const bool is_flag = *crowd == 0 || *crowd == 1;
    if (!dataset_.page_) {
      files_.check(is_flag, kIds, file, who, "its iscrowd is " + crowd->dump(), "0 or 1");
      return;
    }
    const bool is_small = json.at("area").get<double>() < double(below_px);
    const bool holds = (*crowd == 1) == is_small || (*crowd == 1 && can_have_groups());
    files_.check(is_flag && holds, kIds, file, who, "its iscrowd is " + crowd->dump(),
                 is_small ? "1" : "0");
  }

  void check_box_inside(const std::string& who, const PixelBox& box) {
    const int slack = dataset_.page_ ? 0 : 1;
    const bool is_inside = box.x_min >= -slack && box.y_min >= -slack &&
                           box.x_max <= frame_.camera.width + slack &&
                           box.y_max <= frame_.camera.height + slack && !box.is_empty();
    files_.check(is_inside, kInImage, part_.file, who, "its bbox is " + box_text(box),
                 "a box with pixels inside the image");
  }

  CoverageMask read_mask(const Json& json, const std::string& who) {
    const Json& segmentation = json.at("segmentation");
    const Camera& camera = frame_.camera;
    CoverageMask mask;
    if (segmentation.is_array()) {
      mask = mask_of_polygons(polygons_of(segmentation), camera.width, camera.height);
      check_polygon_area(json, who, mask);
      return mask;
    }
    try {
      mask = mask_of_run_lengths(segmentation, camera.width, camera.height);
    } catch (const std::exception& error) {
      files_.find(kReadable, part_.file, who, error.what());
      return mask;
    }
    if (json.contains("area") && is_whole(json.at("bbox"))) {
      const auto count = pixel_count(mask);
      files_.check(json.at("area").get<double>() == double(count), kArea, part_.file, who,
                   "its area is " + json.at("area").dump(),
                   "its mask has " + std::to_string(count) + " pixels");
    }
    return mask;
  }

  /// Of pixels, or of the polygon, which cuts pixels of the outline.
  void check_polygon_area(const Json& json, const std::string& who, const CoverageMask& mask) {
    if (!dataset_.page_ || !json.contains("area")) return;
    const double area = json.at("area").get<double>();
    const auto count = double(pixel_count(mask));
    const double outline = 2.0 * (mask.box.width() + mask.box.height());
    files_.check(std::abs(area - count) <= std::min(outline, 0.2 * count + 2.0), kArea, part_.file,
                 who, "its area is " + json.at("area").dump(),
                 "its polygons have about " + std::to_string(pixel_count(mask)) + " pixels");
  }

  void read_amodal(const Json& json, const std::string& who, const CoverageMask& mask,
                   Instance& instance) {
    const auto entry = json.find("amodal");
    if (entry == json.end()) return;
    Visibility visibility;
    visibility.visible_pixels = pixel_count(mask);
    visibility.amodal_mask =
        mask_of_run_lengths(entry->at("segmentation"), frame_.camera.width, frame_.camera.height);
    visibility.amodal_pixels = pixel_count(visibility.amodal_mask);
    visibility.amodal_box = box_of_json(entry->at("bbox"));
    files_.check(whole_number<std::int64_t>(entry->at("area")) == visibility.amodal_pixels, kArea,
                 part_.file, who, "its amodal area is " + entry->at("area").dump(),
                 "its amodal mask has " + std::to_string(visibility.amodal_pixels) + " pixels");
    files_.check(*visibility.amodal_box == visibility.amodal_mask.extent(), kBox, part_.file, who,
                 "its amodal bbox is " + box_text(*visibility.amodal_box),
                 "its amodal mask extends over " + box_text(visibility.amodal_mask.extent()));
    const double occlusion = entry->at("occlusion").get<double>();
    const double expected = visibility.occlusion().value_or(0.0);
    files_.check(std::abs(occlusion - expected) <= 1e-6, kAmodal, part_.file, who,
                 "its occlusion is " + std::to_string(occlusion),
                 "its masks give " + std::to_string(expected));
    const double truncation = entry->at("truncation").get<double>();
    files_.check(truncation >= 0.0 && truncation < 1.0, kAmodal, part_.file, who,
                 "its truncation is " + std::to_string(truncation), "a share below 1");
    cut_off(truncation, visibility);
    for (const Json& front : entry->at("occluded_by")) {
      occluded_by_.push_back({front.at("node").get<std::string>(), instance.id,
                              whole_number<std::int64_t>(front.at("pixels"))});
    }
    instance.visibility = std::move(visibility);
  }

  static void cut_off(double truncation, Visibility& visibility) {
    if (truncation <= 0.0 || truncation >= 1.0) return;
    visibility.outside_pixels = std::llround(
        std::min(double(visibility.amodal_pixels) * truncation / (1.0 - truncation), 1e15));
  }

  /// What the entry says of the whole object, where nobody wants masks.
  static void read_shares(const Json& json, Instance& instance) {
    const auto entry = json.find("amodal");
    if (entry == json.end()) return;
    Visibility visibility;
    visibility.visible_pixels = whole_number<std::int64_t>(json.at("area"));
    visibility.amodal_pixels = whole_number<std::int64_t>(entry->at("area"));
    visibility.amodal_box = box_of_json(entry->at("bbox"));
    cut_off(entry->at("truncation").get<double>(), visibility);
    instance.visibility = std::move(visibility);
  }

  void read_keypoints(const Json& json, const std::string& who, const StoredCategory& category,
                      std::uint32_t id) {
    if (!json.contains("keypoints")) return;
    const auto numbers = json.at("keypoints").get<std::vector<double>>();
    files_.check(numbers.size() % 3 == 0, kReadable, part_.file, who,
                 "its keypoints are not threes of numbers");
    files_.check(category.keypoint_count == 0 || numbers.size() == 3 * category.keypoint_count,
                 kCounts, part_.file, who,
                 "has " + std::to_string(numbers.size() / 3) + " keypoints",
                 std::to_string(category.keypoint_count) + ", as its category names");
    int count = 0;
    Eigen::AlignedBox2d extent;
    for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
      const double flag = numbers[i + 2];
      files_.check(flag == 0.0 || flag == 1.0 || flag == 2.0, kKeypoints, part_.file, who,
                   "a keypoint's visibility is " + std::to_string(flag), "0, 1 or 2");
      if (wanted_.contains(kHoldsKeypoints)) {
        const Vec2 pixel(numbers[i], numbers[i + 1]);
        const auto sight = flag == 2.0   ? StoredKeypoint::Sight::Seen
                           : flag == 1.0 ? StoredKeypoint::Sight::Hidden
                                         : StoredKeypoint::Sight::NotTold;
        keypoints_[id].push_back(
            {pixel, pixel.allFinite() ? sight : StoredKeypoint::Sight::NotTold});
      }
      if (flag == 0.0) continue;
      ++count;
      extent.extend(Vec2(numbers[i], numbers[i + 1]));
      const bool is_inside = numbers[i] >= 0.0 && numbers[i + 1] >= 0.0 &&
                             numbers[i] <= frame_.camera.width &&
                             numbers[i + 1] <= frame_.camera.height;
      files_.check(is_inside, kKeypoints, part_.file, who,
                   "a keypoint in sight lies outside the image");
    }
    if (json.contains("num_keypoints")) {
      files_.check(whole_number<int>(json.at("num_keypoints")) == count, kArea, part_.file, who,
                   "num_keypoints is " + json.at("num_keypoints").dump(),
                   std::to_string(count) + " keypoints are in the image");
    }
    if (category.has_cuboid_keypoints && count == 9) check_surrounded(json, who, extent);
    if (category.has_cuboid_keypoints) check_diagonals(numbers, who);
  }

  /// A pinhole keeps lines: opposite corners of a box and its middle lie on one.
  void check_diagonals(const std::vector<double>& numbers, const std::string& who) {
    const bool is_pinhole =
        dataset_.tables_.has_cameras && frame_.camera.lens == LensModel::Pinhole;
    if (!is_pinhole || numbers.size() != 3 * kCuboidKeypoints.size()) return;
    const auto point = [&](std::size_t i) { return Vec2(numbers[3 * i], numbers[3 * i + 1]); };
    const auto in_sight = [&](std::size_t i) { return numbers[3 * i + 2] > 0.0; };
    // The middle comes first; behind it, opposite corners are as far from either end.
    constexpr std::size_t kMiddle = 0;
    for (std::size_t i = 1; 2 * i < kCuboidKeypoints.size(); ++i) {
      const std::size_t other = kCuboidKeypoints.size() - i;
      if (!in_sight(i) || !in_sight(other) || !in_sight(kMiddle)) continue;
      const Vec2 along = point(other) - point(i);
      const Vec2 off = point(kMiddle) - point(i);
      const double aside = std::abs(along.x() * off.y() - along.y() * off.x());
      files_.check(aside <= kLineSlack * (along.norm() + off.norm()), kKeypoints, part_.file, who,
                   "the middle of its box is not between corners " + std::to_string(i) + " and " +
                       std::to_string(other));
    }
  }

  /// The corners of a 3-D box surround the object; leaves a tenth for what a lens bends.
  void check_surrounded(const Json& json, const std::string& who,
                        const Eigen::AlignedBox2d& keypoints) {
    const PixelBox box = box_of_json(json.at("bbox"));
    const Vec2 slack = Vec2::Ones() + 0.1 * keypoints.sizes();
    const bool holds =
        ((Vec2(box.x_min, box.y_min) - keypoints.min() + slack).array() >= 0.0).all() &&
        ((keypoints.max() + slack - Vec2(box.x_max, box.y_max)).array() >= 0.0).all();
    files_.check(holds, kReproject, part_.file, who, "its bbox is " + box_text(box),
                 "inside the extent of its keypoints");
  }

  /// Ids, and who hides whom, once all annotations are known.
  void finish(FrameSources& sources) {
    sources.emplace(kHoldsInstances, part_.file);
    for (const OccludedBy& entry : occluded_by_) {
      const auto front = std::ranges::find(frame_.instances, entry.front, &Instance::node_path);
      // What is hidden itself may be in front, and has no annotation.
      if (front != frame_.instances.end()) {
        frame_.occlusions.push_back({front->id, entry.behind, entry.pixels});
      }
    }
    std::ranges::sort(frame_.occlusions, {},
                      [](const Occlusion& o) { return std::pair(o.front, o.behind); });
    if (!wanted_.contains(kInstanceId.name) || !dataset_.tables_.has_masks) return;
    InstancePainter painter(frame_.camera.width, frame_.camera.height);
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      const std::int64_t shared = painter.paint(masks_[i], frame_.instances[i].id);
      if (dataset_.page_) {
        files_.check(shared == 0, kPartition, part_.file, whos_[i],
                     "shares " + std::to_string(shared) + " pixels with others");
      }
    }
    const bool all_have_masks = std::ranges::find(has_mask_, false) == has_mask_.end();
    if (!painter.has_overlaps() && all_have_masks) {
      frame_.set(kInstanceId, painter.take());
      sources.emplace(kInstanceId.name, part_.file);
      return;
    }
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      if (!has_mask_[i]) continue;
      check_box(i);
      // A copy: check_panoptic() has them, too.
      lone_masks_.emplace(frame_.instances[i].id, masks_[i]);
    }
  }

  /// Where the frame cannot show the masks.
  void check_box(std::size_t i) {
    const PixelBox& box = *frame_.instances[i].tight_box;
    const PixelBox extent = masks_[i].extent();
    const int slack = dataset_.page_ ? 0 : 2;
    const bool holds = std::abs(box.x_min - extent.x_min) <= slack &&
                       std::abs(box.y_min - extent.y_min) <= slack &&
                       std::abs(box.x_max - extent.x_max) <= slack &&
                       std::abs(box.y_max - extent.y_max) <= slack;
    files_.check(holds, kBox, part_.file, whos_[i], "its bbox is " + box_text(box),
                 "its mask extends over " + box_text(extent));
  }

  void read_panoptic() {
    Json json;
    files_.reading(part_.panoptic, [&] {
      json = parse_stored_json(read_span(dataset_.folder_ / part_.panoptic, entry_.panoptic));
      const std::string file =
          "panoptic/" + part_.split + "/" + json.at("file_name").get<std::string>();
      const auto picture =
          files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, part_.file);
      if (picture) files_.reading(file, [&] { check_panoptic(file, *picture, json); });
    });
  }

  /// id = red + 256 green + 65536 blue.
  void check_panoptic(const std::string& file, const StoredPicture& picture, const Json& json) {
    struct Segment {
      PixelBox box{1 << 30, 1 << 30, 0, 0};
      std::int64_t count = 0;
    };
    if (picture.channels() < 3) throw std::runtime_error("has no three channels");
    std::map<std::uint32_t, Segment> segments;
    Image<std::uint32_t> ids(picture.width(), picture.height(), 0);
    for (int y = 0; y < picture.height(); ++y) {
      for (int x = 0; x < picture.width(); ++x) {
        const std::uint32_t id =
            picture.at(x, y, 0) | picture.at(x, y, 1) << 8 | picture.at(x, y, 2) << 16;
        ids.at(x, y) = id;
        if (id == 0) continue;
        Segment& segment = segments[id];
        segment.box = {std::min(segment.box.x_min, x), std::min(segment.box.y_min, y),
                       std::max(segment.box.x_max, x + 1), std::max(segment.box.y_max, y + 1)};
        ++segment.count;
      }
    }
    std::map<std::uint32_t, std::int64_t> categories;
    for (const Json& entry : json.at("segments_info")) {
      const auto id = whole_number<std::uint32_t>(entry.at("id"));
      const std::string who = "segment " + std::to_string(id);
      const auto found = segments.find(id);
      files_.check(found != segments.end(), kIds, file, who, "has no pixel");
      const auto category = whole_number<std::int64_t>(entry.at("category_id"));
      files_.check(part_.categories.contains(category), kIds, part_.panoptic, who,
                   "has an unknown category");
      check_crowd(entry, part_.panoptic, who, 0);
      if (found == segments.end()) continue;
      const Segment& segment = found->second;
      files_.check(whole_number<std::int64_t>(entry.at("area")) == segment.count, kArea, file, who,
                   "its area is " + entry.at("area").dump(),
                   std::to_string(segment.count) + " pixels");
      files_.check(box_of_json(entry.at("bbox")) == segment.box, kBox, file, who,
                   "its bbox is " + box_text(box_of_json(entry.at("bbox"))),
                   "its pixels extend over " + box_text(segment.box));
      categories.emplace(id, category);
      segments.erase(found);
    }
    files_.check(segments.empty(), kIds, file, "",
                 std::to_string(segments.size()) + " values have no entry in segments_info");
    if (dataset_.page_) compare_with_annotations(file, ids, categories);
  }

  /// Our writer's segments are the objects' masks.
  void compare_with_annotations(const std::string& file, const Image<std::uint32_t>& ids,
                                const std::map<std::uint32_t, std::int64_t>& categories) {
    std::set<std::uint32_t> annotated;
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      const CoverageMask& mask = masks_[i];
      std::map<std::uint32_t, std::int64_t> below;
      for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
        for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
          if (mask.bits[mask.index(x, y)] != 0) ++below[ids.at(x, y)];
        }
      }
      if (below.empty()) continue;
      annotated.insert(below.begin()->first);
      files_.check(below.size() == 1, kPanoptic, file, whos_[i],
                   "its pixels are of " + std::to_string(below.size()) + " segments");
      const auto category = categories.find(below.begin()->first);
      files_.check(category != categories.end() && category->second == categories_[i], kPanoptic,
                   part_.panoptic, whos_[i],
                   "its segment's category is " +
                       (category == categories.end() ? "none" : std::to_string(category->second)),
                   "its own is " + std::to_string(categories_[i]));
    }
    for (const auto& [id, category] : categories) {
      const auto own = part_.categories.find(category);
      const bool is_thing = own != part_.categories.end() && own->second.is_thing;
      files_.check(!is_thing || annotated.contains(id), kPanoptic, part_.file, "",
                   "has no annotation of segment " + std::to_string(id));
    }
  }

  struct OccludedBy {
    std::string front;
    std::uint32_t behind = 0;
    std::int64_t pixels = 0;
  };

  const CocoDataset& dataset_;
  const CocoPart& part_;
  const CocoImageEntry& entry_;
  Json image_;
  // Of each instance.
  std::vector<std::string> whos_;
  std::vector<std::int64_t> categories_;
  std::vector<CoverageMask> masks_;
  std::vector<bool> has_mask_;
  std::vector<OccludedBy> occluded_by_;
  std::map<std::uint32_t, std::vector<StoredKeypoint>> keypoints_;
  std::map<std::uint32_t, CoverageMask> lone_masks_;
};

StoredCapture CocoDataset::read(std::size_t i, const NameSet& wanted) const {
  const auto images = std::span(tables_.images)
                          .subspan(first_image_.at(i), first_image_.at(i + 1) - first_image_[i]);
  return read_frames(
      info_.captures.at(i), clips_of(page_), images,
      [&](const CocoImageEntry& entry, StoredCapture& stored, FrameSources& sources) {
        stored.split = tables_.parts[entry.part].split;
        CocoImageReading reading(*this, entry, wanted, stored.log);
        std::optional<Frame> frame = reading.read(sources);
        const bool has_keypoints = wanted.contains(kHoldsKeypoints) && tables_.has_keypoints;
        if (frame && has_keypoints) stored.keypoints.push_back(reading.take_keypoints());
        if (frame && wanted.contains(kInstanceId.name)) {
          stored.masks.push_back(reading.take_masks());
        }
        return frame;
      });
}

}  // namespace

std::vector<std::string> CocoReader::patterns() const {
  return {"annotations/*.json", "instances*.json", "annotations.json",
          "labels.json",        "*.coco.json",     "*/_annotations.coco.json"};
}

Recognition CocoReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  return find_coco_parts(folder).empty() ? Recognition::No : Recognition::ByFiles;
}

std::unique_ptr<const StoredDataset> CocoReader::open(const fs::path& folder) const {
  return std::make_unique<CocoDataset>(folder, host_);
}

}  // namespace diorama
