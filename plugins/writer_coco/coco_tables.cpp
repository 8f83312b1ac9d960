// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/coco_tables.h"

#include <algorithm>
#include <set>

#include "diorama/error.h"
#include "writer_coco/video_tracks.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostParts = 1000;
constexpr std::size_t kMostCameras = 60'000;

bool ends_with_any(const std::string& name, std::initializer_list<const char*> endings) {
  return std::ranges::any_of(endings, [&](const char* ending) { return name.ends_with(ending); });
}

/// Annotation files of other tasks, which lie beside those of instances.
bool is_of_another_task(const std::string& name) {
  return std::ranges::any_of(
      std::initializer_list<const char*>{"panoptic_", "captions_", "person_keypoints_", "stuff_",
                                         "image_info_"},
      [&](const char* start) { return name.starts_with(start); });
}

std::string split_of(const std::string& name) {
  std::string stem = fs::path(name).stem().string();
  for (const char* start : {"instances_", "annotations_"}) {
    if (stem.starts_with(start)) return stem.substr(std::string(start).size());
  }
  for (const char* split : {"train", "val", "valid", "test"}) {
    if (stem == split) return stem;
  }
  return {};
}

/// An annotation as it comes, before all images are known.
struct RawAnnotation {
  std::int64_t image_id = 0;
  JsonSpan span;
};

struct RawImage {
  CocoImageEntry entry;
  std::string file_name;
};

/// Reads one annotation file after the other.
class TableReader {
 public:
  TableReader(const fs::path& folder, const std::optional<DatasetPage>& page, StoredFiles& files)
      : folder_(folder), page_(page), files_(files) {}

  CocoTables read() {
    tables_.parts = find_coco_parts(folder_);
    if (page_) tables_.cameras = page_->cameras;
    std::size_t readable = 0;
    for (std::size_t part = 0; part < tables_.parts.size(); ++part) {
      if (read_part(std::uint16_t(part))) ++readable;
    }
    if (readable == 0) {
      throw Error(ErrorKind::Asset,
                  folder_.string() + ": holds no annotation file of COCO that can be read" + why_);
    }
    check_names_once();
    check_tables_complete();
    number_captures();
    if (page_ && tables_.has_tracks) check_video_tracks(folder_, tables_, *page_, tracks_, files_);
    return std::move(tables_);
  }

 private:
  bool read_part(std::uint16_t part) {
    CocoPart& own = tables_.parts[part];
    images_.clear();
    annotations_.clear();
    ids_.clear();
    bool is_whole = true;
    try {
      visit_json_file(folder_ / own.file, [&](const std::string& key, bool is_element,
                                              JsonSpan span, std::string_view text) {
        compare_tables(own.file, key, is_element, text);
        if (!is_element) return;
        if (key == "images") {
          add_image(part, span, parse_stored_json(text));
        } else if (key == "annotations") {
          add_annotation(span, parse_stored_json(text));
        } else if (key == "categories") {
          add_category(own, parse_stored_json(text));
        }
      });
    } catch (const Json::exception& error) {
      is_whole = false;
      note_unreadable(own.file, error.what());
    } catch (const std::runtime_error& error) {
      is_whole = false;
      note_unreadable(own.file, error.what());
    }
    if (!is_whole && images_.empty()) return false;
    std::ranges::sort(images_, {}, [](const CocoImageEntry& image) { return image.id; });
    check_ids(own);
    if (!own.panoptic.empty()) read_panoptic(own);
    join(own);
    return true;
  }

  void note_unreadable(const std::string& file, const std::string& error) {
    files_.find(kReadable, file, "", error);
    why_ += (why_.empty() ? ": " : "; ") + file + ": " + error;
  }

  void add_image(std::uint16_t part, JsonSpan span, const Json& json) {
    CocoImageEntry entry;
    entry.id = whole_number<std::int64_t>(json.at("id"));
    entry.span = span;
    entry.part = part;
    const bool says_capture = json.contains("capture") && json.contains("camera");
    entry.capture = says_capture ? whole_number<std::int32_t>(json.at("capture")) : -1;
    if (says_capture) entry.camera = camera_number(json.at("camera").get<std::string>());
    tables_.has_cameras = tables_.has_cameras || json.contains("intrinsics");
    const auto& name = json.at("file_name").get_ref<const std::string&>();
    tables_.has_lossy_pictures = tables_.has_lossy_pictures || !name.ends_with(".png");
    names_.push_back(tables_.parts[part].file + "\n" + name);
    images_.push_back(entry);
  }

  std::uint16_t camera_number(const std::string& name) {
    const auto found = std::ranges::find(tables_.cameras, name);
    if (found == tables_.cameras.end()) {
      if (tables_.cameras.size() >= kMostCameras) throw std::runtime_error("has too many cameras");
      tables_.cameras.push_back(name);
      return std::uint16_t(tables_.cameras.size() - 1);
    }
    return std::uint16_t(found - tables_.cameras.begin());
  }

  void add_annotation(JsonSpan span, const Json& json) {
    if (json.contains("id")) ids_.push_back(whole_number<std::int64_t>(json.at("id")));
    annotations_.push_back({whole_number<std::int64_t>(json.at("image_id")), span});
    // Others leave the list empty where they have boxes alone.
    const auto mask = json.find("segmentation");
    const bool has_mask = mask != json.end() && (page_ || !mask->empty());
    tables_.has_masks = tables_.has_masks || has_mask;
    tables_.has_amodal = tables_.has_amodal || json.contains("amodal");
    tables_.has_nodes = tables_.has_nodes || json.contains("node");
    tables_.has_keypoints = tables_.has_keypoints || json.contains("keypoints");
    if (!json.contains("track_id")) return;
    tables_.has_tracks = true;
    if (page_) tracks_.push_back(tracked_annotation(json));
  }

  void add_category(CocoPart& part, const Json& json) {
    StoredCategory category;
    category.name = json.at("name").get<std::string>();
    category.is_thing = json.value("isthing", Json(1)) != 0;
    if (const auto points = json.find("keypoints"); points != json.end() && points->is_array()) {
      category.keypoint_count = points->size();
      category.has_cuboid_keypoints =
          points->size() == 9 && points->at(0) == "Center" && points->at(1) == "LDB";
      category.skeleton = skeleton_of(json);
    }
    const std::int64_t id = whole_number<std::int64_t>(json.at("id"));
    const bool has_group = json.contains("supercategory") && json.at("supercategory") != "object";
    tables_.has_own_categories = tables_.has_own_categories || json.contains("color") ||
                                 has_group || id != std::int64_t(part.categories.size()) + 1;
    if (std::ranges::find(tables_.classes, category.name) == tables_.classes.end()) {
      tables_.classes.push_back(category.name);
    }
    const bool is_new = part.categories.emplace(id, std::move(category)).second;
    files_.check(is_new, kOnce, part.file, "category " + std::to_string(id), "is listed twice");
  }

  /// Names that are none, and lines to points that are not there, are nobody's fault but left out.
  static StoredSkeleton skeleton_of(const Json& category) {
    StoredSkeleton skeleton;
    for (const Json& name : category.at("keypoints")) {
      skeleton.names.push_back(name.is_string() ? name.get<std::string>() : name.dump());
    }
    const auto count = std::int64_t(skeleton.names.size());
    const Json lines = category.value("skeleton", Json::array());
    const auto place = [&](const Json& number) {  // from 1
      const bool is_one = number.is_number_integer() && whole_number<std::int64_t>(number) >= 1 &&
                          whole_number<std::int64_t>(number) <= count;
      return is_one ? whole_number<int>(number) - 1 : -1;
    };
    for (const Json& line : lines) {
      if (!line.is_array() || line.size() != 2) continue;
      const std::pair ends(place(line[0]), place(line[1]));
      if (ends.first >= 0 && ends.second >= 0) skeleton.lines.push_back(ends);
    }
    return skeleton;
  }

  void check_ids(const CocoPart& part) {
    for (std::size_t i = 1; i < images_.size(); ++i) {
      files_.check(images_[i].id != images_[i - 1].id, kOnce, part.file,
                   "image " + std::to_string(images_[i].id), "is listed twice");
    }
    std::ranges::sort(ids_);
    for (std::size_t i = 1; i < ids_.size(); ++i) {
      files_.check(ids_[i] != ids_[i - 1], kOnce, part.file,
                   "annotation " + std::to_string(ids_[i]), "is listed twice");
    }
  }

  CocoImageEntry* image_of(std::int64_t id) {
    const auto found = std::ranges::lower_bound(
        images_, id, {}, [](const CocoImageEntry& image) { return image.id; });
    return found == images_.end() || found->id != id ? nullptr : &*found;
  }

  void read_panoptic(const CocoPart& part) {
    std::size_t count = 0;
    images_listed_ = 0;
    files_.reading(part.panoptic, [&] {
      visit_json_file(folder_ / part.panoptic, [&](const std::string& key, bool is_element,
                                                   JsonSpan span, std::string_view text) {
        compare_tables(part.panoptic, key, is_element, text);
        if (!is_element) return;
        if (key == "images") check_same_image(part, text);
        if (key != "annotations") return;
        const std::int64_t id = whole_number<std::int64_t>(parse_stored_json(text).at("image_id"));
        CocoImageEntry* image = image_of(id);
        const std::string who = "image " + std::to_string(id);
        files_.check(image != nullptr, kCounts, part.panoptic, who, "is not in " + part.file);
        if (!image) return;
        files_.check(image->panoptic.length == 0, kOnce, part.panoptic, who, "is listed twice");
        image->panoptic = span;
        ++count;
      });
    });
    files_.check(!page_ || images_listed_ == images_.size(), kCounts, part.panoptic, "",
                 "lists " + std::to_string(images_listed_) + " images",
                 part.file + " lists " + std::to_string(images_.size()));
    files_.check(count == images_.size(), kCounts, part.panoptic, "",
                 "has entries for " + std::to_string(count) + " images",
                 part.file + " lists " + std::to_string(images_.size()));
  }

  /// Our writer lists images in both files in the same words.
  void check_same_image(const CocoPart& part, std::string_view text) {
    if (!page_) return;
    ++images_listed_;
    const Json json = parse_stored_json(text);
    const std::int64_t id = whole_number<std::int64_t>(json.at("id"));
    const CocoImageEntry* image = image_of(id);
    if (!image)
      return files_.find(kCounts, part.panoptic, "image " + std::to_string(id),
                         "is not in " + part.file);
    const Json own = parse_stored_json(read_span(folder_ / part.file, image->span));
    files_.check(own == json, kCounts, part.panoptic, "image " + std::to_string(id),
                 "is described otherwise than in " + part.file);
  }

  /// What our writer puts into each of its annotation files: categories and licences.
  void compare_tables(const std::string& file, const std::string& key, bool is_element,
                      std::string_view text) {
    if (!page_) return;
    if (!is_element || (key != "categories" && key != "licenses")) return;
    Json entry = parse_stored_json(text);
    const std::size_t place = counted_[file][key]++;
    std::vector<Json>& known = first_tables_[key];
    if (place < known.size()) {
      files_.check(known[place] == entry, kCounts, file, key + " " + std::to_string(place),
                   "is not what " + first_file_ + " has");
    } else if (first_file_.empty() || first_file_ == file) {
      first_file_ = file;
      known.push_back(std::move(entry));
    } else {
      files_.find(kCounts, file, key + " " + std::to_string(place), "is not in " + first_file_);
    }
  }

  void check_tables_complete() {
    if (!page_) return;
    for (const CocoPart& part : tables_.parts) {
      for (const std::string& file : {part.file, part.panoptic}) {
        if (file.empty() || !counted_.contains(file)) continue;
        for (const auto& [key, entries] : first_tables_) {
          files_.check(counted_[file][key] == entries.size(), kCounts, file, key,
                       "has " + std::to_string(counted_[file][key]) + " entries",
                       first_file_ + " has " + std::to_string(entries.size()));
        }
      }
    }
    const auto json = files_.has("categories.json") ? files_.json("categories.json") : std::nullopt;
    if (!json) return;
    const std::vector<Json>& categories = first_tables_["categories"];
    files_.check(json->is_array() && std::vector<Json>(json->begin(), json->end()) == categories,
                 kCounts, "categories.json", "", "lists other categories than " + first_file_);
  }

  /// Puts the annotations of each image behind each other.
  void join(const CocoPart& part) {
    std::ranges::stable_sort(annotations_, {}, &RawAnnotation::image_id);
    std::size_t at = 0;
    for (CocoImageEntry& image : images_) {
      for (; at < annotations_.size() && annotations_[at].image_id < image.id; ++at)
        unknown(part, at);
      image.first_annotation = std::uint32_t(tables_.annotations.size());
      for (; at < annotations_.size() && annotations_[at].image_id == image.id; ++at) {
        tables_.annotations.push_back(annotations_[at].span);
      }
      image.annotation_count = std::uint32_t(tables_.annotations.size()) - image.first_annotation;
    }
    for (; at < annotations_.size(); ++at) unknown(part, at);
    tables_.images.insert(tables_.images.end(), images_.begin(), images_.end());
  }

  void unknown(const CocoPart& part, std::size_t at) {
    files_.check(
        false, kCounts, part.file, "",
        "has an annotation of the unknown image " + std::to_string(annotations_[at].image_id));
  }

  /// A picture listed twice, in one split or in two.
  void check_names_once() {
    std::vector<std::pair<std::string, std::string>> by_name;
    for (std::string& name : names_) {
      const std::size_t cut = name.find('\n');
      by_name.emplace_back(name.substr(cut + 1), name.substr(0, cut));
    }
    names_.clear();
    names_.shrink_to_fit();
    std::ranges::sort(by_name);
    for (std::size_t i = 1; i < by_name.size(); ++i) {
      // Splits of other people may have folders of their own, with equal names inside.
      const bool may_repeat = !page_ && by_name[i].second != by_name[i - 1].second;
      files_.check(may_repeat || by_name[i].first != by_name[i - 1].first, kOnce, by_name[i].second,
                   by_name[i].first, "is listed in " + by_name[i - 1].second + " too");
    }
  }

  void number_captures() {
    tables_.has_captures = std::ranges::all_of(
        tables_.images, [](const CocoImageEntry& image) { return image.capture >= 0; });
    if (!tables_.has_captures || tables_.cameras.empty()) {
      tables_.has_captures = false;
      tables_.cameras = {"camera"};
      for (std::size_t i = 0; i < tables_.images.size(); ++i) {
        tables_.images[i].capture = std::int32_t(i);
        tables_.images[i].camera = 0;
      }
      return;
    }
    std::ranges::stable_sort(tables_.images, {}, [](const CocoImageEntry& image) {
      return std::pair(image.capture, image.camera);
    });
    for (std::size_t i = 1; i < tables_.images.size(); ++i) {
      const CocoImageEntry& a = tables_.images[i - 1];
      const CocoImageEntry& b = tables_.images[i];
      files_.check(a.capture != b.capture || a.camera != b.camera, kOnce,
                   tables_.parts[b.part].file, "image " + std::to_string(b.id),
                   "is of the capture and camera of image " + std::to_string(a.id));
    }
  }

  const fs::path& folder_;
  const std::optional<DatasetPage>& page_;
  StoredFiles& files_;
  CocoTables tables_;
  std::vector<CocoImageEntry> images_;  ///< Of one part.
  std::vector<RawAnnotation> annotations_;
  std::vector<std::int64_t> ids_;
  std::vector<TrackedAnnotation> tracks_;  ///< Of all parts of our own writer.
  std::vector<std::string> names_;
  std::size_t images_listed_ = 0;  ///< By the panoptic file.
  std::string why_;                ///< What could not be read, and why; for when that is all.
  std::string first_file_;
  std::map<std::string, std::vector<Json>> first_tables_;  ///< By key, of the first file.
  std::map<std::string, std::map<std::string, std::size_t>> counted_;  ///< By file, by key.
};

}  // namespace

std::vector<CocoPart> find_coco_parts(const fs::path& folder) {
  std::vector<CocoPart> all;
  const auto take = [&](const std::string& below, const std::string& name,
                        const std::string& split) {
    if (is_of_another_task(name) || all.size() >= kMostParts) return;
    const std::string front = below.empty() ? "" : below + "/";
    CocoPart part{front + name, split.empty() ? split_of(name) : split, "", {}};
    const std::string panoptic = front + "panoptic_" + part.split + ".json";
    if (name.starts_with("instances_") && fs::is_regular_file(folder / panoptic)) {
      part.panoptic = panoptic;
    }
    all.push_back(std::move(part));
  };
  for (const std::string& name : names_in(folder / "annotations")) {
    if (name.ends_with(".json")) take("annotations", name, "");
  }
  for (const std::string& name : names_in(folder)) {
    // The last one beside a folder "data" with the pictures.
    const bool fits = name.starts_with("instances") || name == "annotations.json" ||
                      (name == "labels.json" && fs::is_directory(folder / "data"));
    if (ends_with_any(name, {".json"}) && (fits || name.ends_with(".coco.json")))
      take("", name, "");
  }
  for (const std::string& below : names_in(folder, true)) {
    if (fs::is_regular_file(folder / below / "_annotations.coco.json")) {
      take(below, "_annotations.coco.json", below);
    }
  }
  const auto is_of_instances = [](const CocoPart& part) {
    return fs::path(part.file).filename().string().starts_with("instances_");
  };
  if (std::ranges::any_of(all, is_of_instances)) {
    std::erase_if(all, [&](const CocoPart& part) { return !is_of_instances(part); });
  }
  return all;
}

CocoTables read_coco_tables(const fs::path& folder, const std::optional<DatasetPage>& page,
                            StoredFiles& files) {
  return TableReader(folder, page, files).read();
}

}  // namespace diorama
