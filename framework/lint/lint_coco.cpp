// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>

#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

constexpr const char* kBox = "box = extent of mask";
constexpr const char* kArea = "area = count";
constexpr const char* kPartition = "pixels partition into instances";
constexpr const char* kOrder = "occlusion order agrees with masks";

/// Pixels of an image whose centres lie in one of the polygons, row by row.
std::vector<bool> fill_polygons(const Json& polygons, std::size_t width, std::size_t height) {
  std::vector<bool> mask(width * height, false);
  for (const Json& polygon : polygons) {
    const auto numbers = polygon.get<std::vector<double>>();
    if (numbers.size() < 6 || numbers.size() % 2 != 0) {
      throw std::runtime_error("a polygon has " + std::to_string(numbers.size()) + " numbers");
    }
    std::vector<double> crossings;
    for (std::size_t row = 0; row < height; ++row) {
      const double line = double(row) + 0.5;
      crossings.clear();
      for (std::size_t i = 0; i < numbers.size(); i += 2) {
        const std::size_t j = (i + 2) % numbers.size();
        if ((numbers[i + 1] <= line) == (numbers[j + 1] <= line)) continue;
        crossings.push_back(numbers[i] + (line - numbers[i + 1]) /
                                             (numbers[j + 1] - numbers[i + 1]) *
                                             (numbers[j] - numbers[i]));
      }
      std::ranges::sort(crossings);
      const auto column = [width](double x) {
        return std::size_t(std::clamp(std::ceil(x - 0.5), 0.0, double(width)));
      };
      for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
        for (std::size_t x = column(crossings[i]); x < column(crossings[i + 1]); ++x) {
          mask[row * width + x] = true;
        }
      }
    }
  }
  return mask;
}

/// Pixels of a run-length mask, row by row. Throws when the runs do not fill the size.
std::vector<bool> decode_mask(const Json& rle) {
  const auto height = rle.at("size").at(0).get<std::size_t>();
  const auto width = rle.at("size").at(1).get<std::size_t>();
  std::vector<long> runs;
  if (rle.at("counts").is_array()) {
    runs = rle.at("counts").get<std::vector<long>>();
  } else {
    const std::string text = rle.at("counts").get<std::string>();
    for (std::size_t at = 0; at < text.size();) {
      long value = 0;
      int shift = 0;
      int group = 0x20;
      while ((group & 0x20) != 0) {
        if (at >= text.size() || shift > 50) throw std::runtime_error("run lengths are cut short");
        group = text[at++] - 48;
        value |= long(group & 0x1F) << shift;
        shift += 5;
      }
      if ((group & 0x10) != 0) value |= -1L << shift;
      if (runs.size() > 2) value += runs[runs.size() - 2];
      runs.push_back(value);
    }
  }
  std::vector<bool> mask(width * height, false);
  std::size_t at = 0;
  bool is_set = false;
  for (const long run : runs) {
    if (run < 0 || at + std::size_t(run) > mask.size()) {
      throw std::runtime_error("run lengths exceed the image");
    }
    for (long i = 0; i < run; ++i, ++at) mask[at % height * width + at / height] = is_set;
    is_set = !is_set;
  }
  if (at != mask.size()) throw std::runtime_error("run lengths do not fill the image");
  return mask;
}

Extent extent_of(const std::vector<bool>& mask, std::size_t width) {
  Extent extent;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i]) extent.add(int(i % width), int(i / width));
  }
  return extent;
}

PixelBox box_of(const Json& bbox) {
  const int x = bbox.at(0).get<int>();
  const int y = bbox.at(1).get<int>();
  return {x, y, x + bbox.at(2).get<int>(), y + bbox.at(3).get<int>()};
}

/// What occlusion order is checked against.
struct WholeObject {
  std::string who;
  std::vector<bool> visible;
  std::vector<bool> whole;
  std::map<std::string, std::size_t> occluded_by;  ///< Pixels by node.
};

struct CocoImage {
  std::string file;
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<bool> taken;                      ///< By the masks so far.
  std::map<std::string, WholeObject> wholes{};  ///< By node.
};

std::size_t count_shared(const std::vector<bool>& a, const std::vector<bool>& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) {
    if (a[i] && b[i]) ++count;
  }
  return count;
}

/// In how many pixels two objects of a picture lie over each other, counted for all pairs at once.
class Overlaps {
 public:
  explicit Overlaps(const std::map<std::string, WholeObject>& objects)
      : size_(objects.size()), shared_(size_ * size_, 0), seen_(size_ * size_, 0) {
    std::size_t pixels = 0;
    for (const auto& [node, object] : objects) pixels = std::max(pixels, object.whole.size());
    std::vector<std::size_t> here;
    std::vector<std::size_t> in_sight;
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
      here.clear();
      in_sight.clear();
      std::size_t index = 0;
      for (const auto& [node, object] : objects) {
        if (pixel < object.whole.size() && object.whole[pixel]) here.push_back(index);
        if (pixel < object.visible.size() && object.visible[pixel]) in_sight.push_back(index);
        ++index;
      }
      for (const std::size_t a : here) {
        for (const std::size_t b : here) ++shared_[a * size_ + b];
        for (const std::size_t front : in_sight) ++seen_[front * size_ + a];
      }
    }
  }

  /// Pixels of both whole masks. Objects are numbered in the map's order.
  std::size_t shared(std::size_t a, std::size_t b) const { return shared_[a * size_ + b]; }
  /// Pixels where `front` is seen and `behind` would be.
  std::size_t seen(std::size_t front, std::size_t behind) const {
    return seen_[front * size_ + behind];
  }

 private:
  std::size_t size_;
  std::vector<std::size_t> shared_;
  std::vector<std::size_t> seen_;
};

class CocoPart {
 public:
  CocoPart(Dataset& dataset, std::string file, std::string split)
      : dataset_(dataset), file_(std::move(file)), split_(std::move(split)) {}

  /// `pictures` are those that dataset.json plans.
  void instances(const Json& categories, std::size_t pictures) {
    const auto json = dataset_.json(file_);
    if (!json) return;
    dataset_.reading(file_, [&] {
      dataset_.check(json->at("categories") == categories, "ids within the label map", file_,
                     "its categories are not those of categories.json");
      dataset_.check(json->at("images").size() == pictures, "counts agree between files", file_,
                     "lists " + std::to_string(json->at("images").size()) + " images of " +
                         std::to_string(pictures));
      read_images(*json);
      check_annotations(json->at("annotations"));
    });
  }

  void panoptic(std::size_t pictures) {
    const auto json = dataset_.json(file_);
    if (!json) return;
    dataset_.reading(file_, [&] {
      dataset_.check(json->at("annotations").size() == pictures, "counts agree between files",
                     file_, "has not one annotation per picture");
      for (const Json& category : json->at("categories")) {
        categories_.insert(category.at("id").get<int>());
      }
      for (const Json& annotation : json->at("annotations")) check_panoptic(annotation);
    });
  }

 private:
  void read_images(const Json& json) {
    for (const Json& category : json.at("categories")) {
      categories_.insert(category.at("id").get<int>());
    }
    for (const Json& entry : json.at("images")) {
      CocoImage image;
      image.file = "images/" + split_ + "/" + entry.at("file_name").get<std::string>();
      image.width = entry.at("width").get<std::size_t>();
      image.height = entry.at("height").get<std::size_t>();
      image.taken.assign(image.width * image.height, false);
      if (const auto picture = dataset_.picture(image.file)) {
        dataset_.check(std::size_t(picture->width) == image.width &&
                           std::size_t(picture->height) == image.height,
                       "counts agree between files", image.file,
                       "has another size than " + file_ + " says");
      }
      const bool is_new = images_.emplace(entry.at("id").get<int>(), std::move(image)).second;
      dataset_.check(is_new, "counts agree between files", file_, "an image id occurs twice");
    }
  }

  /// Picture by picture, so that the masks of one only are in memory.
  void check_annotations(const Json& annotations) {
    std::map<int, std::vector<const Json*>> by_image;
    for (const Json& annotation : annotations) {
      by_image[annotation.at("image_id").get<int>()].push_back(&annotation);
    }
    for (const auto& [id, own] : by_image) {
      for (const Json* annotation : own) check_annotation(*annotation);
      const auto image = images_.find(id);
      if (image == images_.end()) continue;
      check_order(image->second);
      image->second.wholes.clear();
      image->second.taken = {};
    }
  }

  void check_annotation(const Json& annotation) {
    const std::string who = "annotation " + annotation.at("id").dump();
    dataset_.check(ids_.insert(annotation.at("id").get<int>()).second, "counts agree between files",
                   file_, who + " occurs twice");
    dataset_.check(categories_.contains(annotation.at("category_id").get<int>()),
                   "ids within the label map", file_, who + " has an unknown category");
    const auto image = images_.find(annotation.at("image_id").get<int>());
    dataset_.check(image != images_.end(), "counts agree between files", file_,
                   who + " is about an unknown image");
    if (image == images_.end()) return;
    const Json& segmentation = annotation.at("segmentation");
    const auto mask = segmentation.is_array()
                          ? fill_polygons(segmentation, image->second.width, image->second.height)
                          : decode_mask(segmentation);
    if (mask.size() != image->second.taken.size()) {
      dataset_.find("counts agree between files", file_, who + ": mask and image differ in size");
      return;
    }
    check_mask(annotation, who, mask, image->second.width);
    const std::size_t shared = count_shared(mask, image->second.taken);
    for (std::size_t i = 0; i < mask.size(); ++i) {
      if (mask[i]) image->second.taken[i] = true;
    }
    dataset_.check(shared == 0, kPartition, file_,
                   who + " shares " + std::to_string(shared) + " pixels with others");
    check_amodal(annotation, who, mask, image->second);
    check_keypoints(annotation, who, image->second);
  }

  void check_mask(const Json& annotation, const std::string& who, const std::vector<bool>& mask,
                  std::size_t width) {
    const Extent extent = extent_of(mask, width);
    const PixelBox box = box_of(annotation.at("bbox"));
    dataset_.check(
        box == extent.box, kBox, file_,
        who + ": bbox " + box_text(box) + ", its mask extends over " + box_text(extent.box));
    dataset_.check(annotation.at("area").get<double>() == double(extent.count), kArea, file_,
                   who + ": area " + annotation.at("area").dump() + ", its mask has " +
                       std::to_string(extent.count) + " pixels");
  }

  void check_amodal(const Json& annotation, const std::string& who,
                    const std::vector<bool>& visible, CocoImage& image) {
    if (!annotation.contains("amodal")) return;
    const Json& amodal = annotation.at("amodal");
    WholeObject object{who, visible, decode_mask(amodal.at("segmentation")), {}};
    std::size_t beyond = 0;
    for (std::size_t i = 0; i < visible.size() && i < object.whole.size(); ++i) {
      if (visible[i] && !object.whole[i]) ++beyond;
    }
    dataset_.check(
        beyond == 0 && object.whole.size() == visible.size(), "visible <= amodal", file_,
        who + ": " + std::to_string(beyond) + " visible pixels lie outside its amodal mask");
    for (const Json& front : amodal.at("occluded_by")) {
      object.occluded_by[front.at("node").get<std::string>()] =
          front.at("pixels").get<std::size_t>();
    }
    image.wholes.insert_or_assign(annotation.at("node").get<std::string>(), std::move(object));
  }

  /// Where one is seen and the other's whole mask lies it is in front; in no pixel are both.
  void check_order(const CocoImage& image) {
    const Overlaps overlaps(image.wholes);
    std::size_t i = 0;
    for (auto a = image.wholes.begin(); a != image.wholes.end(); ++a, ++i) {
      std::size_t j = i + 1;
      for (auto b = std::next(a); b != image.wholes.end(); ++b, ++j) {
        const std::size_t a_behind = check_behind(a->second, b->first, overlaps.seen(j, i));
        const std::size_t b_behind = check_behind(b->second, a->first, overlaps.seen(i, j));
        const std::size_t shared = overlaps.shared(i, j);
        dataset_.check(a_behind + b_behind <= shared, kOrder, file_,
                       a->second.who + " and " + b->second.who + " share " +
                           std::to_string(shared) + " pixels, the order says " +
                           std::to_string(a_behind + b_behind));
      }
    }
  }

  /// Returns the pixels in which `behind` says that it lies behind `front`, which is seen before it
  /// in `seen` pixels.
  std::size_t check_behind(const WholeObject& behind, const std::string& front, std::size_t seen) {
    const auto count = behind.occluded_by.find(front);
    const std::size_t pixels = count == behind.occluded_by.end() ? 0 : count->second;
    dataset_.check(pixels >= seen, kOrder, file_,
                   behind.who + ": " + front + " is in front of it in " + std::to_string(seen) +
                       " pixels, 'occluded_by' says " + std::to_string(pixels));
    return pixels;
  }

  void check_keypoints(const Json& annotation, const std::string& who, const CocoImage& image) {
    if (!annotation.contains("keypoints")) return;
    const auto numbers = annotation.at("keypoints").get<std::vector<double>>();
    std::size_t count = 0;
    Eigen::AlignedBox2d extent;
    for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
      if (numbers[i + 2] == 0.0) continue;
      ++count;
      extent.extend(Vec2(numbers[i], numbers[i + 1]));
      const bool is_inside = numbers[i] >= 0.0 && numbers[i + 1] >= 0.0 &&
                             numbers[i] <= double(image.width) &&
                             numbers[i + 1] <= double(image.height);
      dataset_.check(is_inside, "keypoints project onto their pixels", file_,
                     who + ": a keypoint in sight lies outside the image");
    }
    dataset_.check(annotation.at("num_keypoints").get<std::size_t>() == count, "area = count",
                   file_, who + ": num_keypoints is not the number of keypoints in the image");
    if (count * 3 != numbers.size()) return;
    const PixelBox box = box_of(annotation.at("bbox"));
    check_surrounded(dataset_, file_, who,
                     Vec2(0.5 * (box.x_min + box.x_max), 0.5 * (box.y_min + box.y_max)),
                     Vec2(box.width(), box.height()), extent);
  }

  void check_panoptic(const Json& annotation) {
    const std::string file =
        "panoptic/" + split_ + "/" + annotation.at("file_name").get<std::string>();
    const auto picture = dataset_.picture(file);
    if (!picture) return;
    std::map<std::uint32_t, Extent> masks;
    for (const auto& [value, extent] : extents(*picture)) {
      if ((value & 0xFFFFFF) != 0) masks[value & 0xFFFFFF] = extent;
    }
    for (const Json& segment : annotation.at("segments_info")) {
      const auto mask = masks.find(segment.at("id").get<std::uint32_t>());
      const std::string who = "segment " + segment.at("id").dump();
      dataset_.check(mask != masks.end(), "ids within the label map", file, who + " has no pixel");
      dataset_.check(categories_.contains(segment.at("category_id").get<int>()),
                     "ids within the label map", file_, who + " has an unknown category");
      if (mask == masks.end()) continue;
      dataset_.check(segment.at("area").get<std::int64_t>() == mask->second.count, kArea, file,
                     who + ": area " + segment.at("area").dump() + ", but " +
                         std::to_string(mask->second.count) + " pixels");
      dataset_.check(box_of(segment.at("bbox")) == mask->second.box, kBox, file,
                     who + ": its pixels extend over " + box_text(mask->second.box));
      masks.erase(mask);
    }
    dataset_.check(masks.empty(), "ids within the label map", file,
                   std::to_string(masks.size()) + " values have no entry in segments_info");
  }

  Dataset& dataset_;
  std::string file_;
  std::string split_;
  std::set<int> categories_;
  std::set<int> ids_;
  std::map<int, CocoImage> images_;
};

}  // namespace

void lint_coco(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  std::map<std::string, std::size_t> pictures;
  std::vector<std::string> panoptic;
  for (const PlannedPicture& picture : page.pictures) {
    ++pictures[picture.split];
    const std::string stem = "images/" + picture.split + "/" + picture.stem;
    dataset.check(dataset.has(stem + ".png") || dataset.has(stem + ".jpg"), "nothing is missing",
                  stem, "the picture is missing");
    panoptic.push_back("panoptic/" + picture.split + "/" + picture.stem + ".png");
  }
  for (const auto& [split, count] : pictures) {
    panoptic.push_back("annotations/panoptic_" + split + ".json");
  }
  check_all_or_none(dataset, panoptic);
  const auto categories = dataset.json("categories.json");
  for (const auto& [split, count] : pictures) {
    CocoPart(dataset, "annotations/instances_" + split + ".json", split)
        .instances(categories.value_or(Json()), count);
    const std::string file = "annotations/panoptic_" + split + ".json";
    if (dataset.has(file)) CocoPart(dataset, file, split).panoptic(count);
  }
}

}  // namespace diorama::lint
