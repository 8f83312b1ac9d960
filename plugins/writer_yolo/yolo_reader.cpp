// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/yolo_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>

#include "diorama/error.h"
#include "reader_support/capture_rows.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"
#include "reader_support/object_masks.h"
#include "reader_support/picture_list.h"
#include "writer_support/cuboid.h"
#include "writer_yolo/data_yaml.h"
#include "writer_yolo/polygon_parts.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "YOLO";
constexpr const char* kReproject = "pose and camera reproject onto the mask";
/// How many label files are looked at to tell rotated boxes from polygons of four points.
constexpr std::size_t kSampledFiles = 64;
/// Rounding of boxes that lie round objects, but not along their pixels.
constexpr double kAnywhere = 1e4;

enum class Task { Boxes, Polygons, Keypoints, RotatedBoxes };

/// A folder with pictures, and where their labels lie.
struct PictureFolder {
  std::string split;
  std::string pictures;  ///< "images/train/", relative; empty: the dataset itself.
  std::string labels;    ///< "labels/train/".
};

std::string with_slash(std::string folder) {
  if (folder == "." || folder.empty()) return {};
  if (!folder.ends_with('/')) folder += '/';
  return folder;
}

/// Ultralytics' rule: the last "images" of a path becomes "labels".
std::string labels_beside(const std::string& pictures) {
  const std::string framed = "/" + pictures;
  const std::size_t at = framed.rfind("/images/");
  if (at == framed.npos) return pictures;
  return (framed.substr(0, at) + "/labels/" + framed.substr(at + 8)).substr(1);
}

/// A page with names of classes and places of splits, whatever it is called; nothing for others'.
std::optional<DataYaml> page_in(const fs::path& file) {
  try {
    constexpr std::uintmax_t kMostBytes = std::uintmax_t(1) << 24;
    DataYaml yaml = parse_data_yaml(read_whole_file(file, kMostBytes));
    if (!yaml.names.empty() && !yaml.splits.empty()) return yaml;
  } catch (const std::runtime_error&) {
    // It says nothing of YOLO.
  }
  return std::nullopt;
}

/// Name of the page that describes a dataset: "data.yaml", or the only one of its kind, such as
/// "coco128.yaml"; empty when there is none.
std::string page_name(const fs::path& folder) {
  constexpr std::size_t kMostLooked = 20;
  for (const char* name : {"data.yaml", "dataset.yaml"}) {
    std::error_code ignored;
    if (fs::is_regular_file(folder / name, ignored)) return name;
  }
  std::string found;
  std::size_t looked = 0;
  for (const std::string& name : names_in(folder)) {
    const bool is_yaml = name.ends_with(".yaml") || name.ends_with(".yml");
    if (!is_yaml || ++looked > kMostLooked || !page_in(folder / name)) continue;
    if (!found.empty()) return {};
    found = name;
  }
  return found;
}

/// "classes.txt" of labelling tools, or a list of Darknet's; empty when there is none.
std::string class_list_name(const fs::path& folder) {
  std::error_code ignored;
  if (fs::is_regular_file(folder / "classes.txt", ignored)) return "classes.txt";
  for (const std::string& name : names_in(folder)) {
    if (name.ends_with(".names")) return name;
  }
  return {};
}

/// Some picture has labels of its name beside it, as Darknet and labelling tools have it.
bool has_labels_beside_pictures(const fs::path& folder) {
  for (const ListedPicture& picture : pictures_in(folder, 0)) {
    const fs::path labels = folder / (picture.stem + ".txt");
    std::error_code ignored;
    if (!fs::is_regular_file(labels, ignored)) continue;
    try {
      for (const std::string& line : text_lines(read_whole_file(labels))) {
        const std::vector<std::string> words = text_words(line);
        if (words.empty()) continue;
        integer_of(words[0]);
        return numbers_from(words, 1).size() >= 4;
      }
    } catch (const std::runtime_error&) {
      return false;  // Some other text.
    }
  }
  return false;
}

class YoloDataset final : public StoredDataset {
 public:
  YoloDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    read_yaml(files);
    find_folders(files);
    std::vector<std::string> places;
    for (const PictureFolder& each : folders_) places.push_back(each.pictures);
    pictures_.set(
        find_pictures(files), page_,
        [&](const std::string& stem) { return capture_and_camera(*page_, stem); }, places, files);
    if (pictures_.all().empty() && yaml_.names.empty()) {
      throw Error(ErrorKind::Asset,
                  folder_.string() + ": holds neither pictures nor a data.yaml of YOLO");
    }
    choose_task(files);
    describe();
    note_clips(clips_of(page_), info_);
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  void read_yaml(StoredFiles& files) {
    yaml_file_ = page_name(folder_);
    if (yaml_file_.empty()) {
      files.check(!page_, kMissing, "data.yaml", "", "the file is not there");
      read_class_list(files);
      return;
    }
    if (const auto text = files.text(yaml_file_)) {
      files.reading(yaml_file_, [&] { yaml_ = parse_data_yaml(*text); });
    }
    const auto count = std::to_string(yaml_.names.size());
    files.check(!yaml_.nc || std::size_t(*yaml_.nc) == yaml_.names.size(), kIds, yaml_file_, "nc",
                "is " + std::to_string(yaml_.nc.value_or(0)),
                count + ", as many as there are names");
    if (page_) {
      check_own_splits(files);
      std::vector<std::string> names;
      for (const auto& [id, name] : yaml_.names) names.push_back(name);
      files.check(names == page_->classes, kIds, yaml_file_, "",
                  "its names are not the classes of dataset.json");
    }
  }

  /// Without pictures for validation those for training stand there, too.
  void check_own_splits(StoredFiles& files) {
    const bool has_validation = std::ranges::any_of(
        page_->split_of_capture, [](const auto& each) { return each.second == "val"; });
    for (const std::string split : {"train", "val"}) {
      const std::string folder =
          "images/" + (split == "val" && !has_validation ? std::string("train") : split);
      files.check(yaml_.splits[split] == std::vector<std::string>{folder}, kCounts, yaml_file_,
                  split, "is not " + folder, "the folder of the pictures that dataset.json lists");
    }
  }

  /// One name a line, in the order of the classes.
  void read_class_list(StoredFiles& files) {
    const std::string name = class_list_name(folder_);
    const auto text = name.empty() ? std::nullopt : files.text(name);
    if (!text) return;
    for (const std::string& line : text_lines(*text)) {
      if (!text_words(line).empty()) yaml_.names.emplace(int(yaml_.names.size()), line);
    }
  }

  /// A folder that data.yaml names, relative to the dataset; empty when there is none. People move
  /// datasets: what is not where the file says is looked for in the dataset.
  std::optional<std::string> located(const std::string& said) const {
    const fs::path name(said);
    std::vector<fs::path> tries{fs::path(yaml_.path) / name, name};
    if (!page_) std::ranges::copy(possible_places(said), std::back_inserter(tries));
    std::error_code ignored;
    for (const fs::path& each : tries) {
      const fs::path plain = each.lexically_normal();
      // Nothing outside of the dataset's folder is read.
      if (plain.is_absolute() || (!plain.empty() && *plain.begin() == "..")) continue;
      if (fs::exists(folder_ / plain, ignored)) return plain.generic_string();
    }
    return std::nullopt;
  }

  void find_folders(StoredFiles& files) {
    std::set<std::string> taken;
    const auto take = [&](const std::string& split, const std::string& folder) {
      const std::string pictures = with_slash(folder);
      if (!taken.insert(pictures).second) return;
      folders_.push_back({split, pictures, labels_beside(pictures)});
    };
    for (const auto& [split, places] : yaml_.splits) {
      for (const std::string& said : places) {
        const auto place = located(said);
        // An empty split may have no folder.
        if (!place) continue;
        if (fs::is_directory(folder_ / *place)) {
          take(split, *place);
        } else if (taken.insert(*place).second) {
          lists_.emplace_back(split, *place);
        }
      }
    }
    if (folders_.empty() && lists_.empty()) look_around(take);
    if (folders_.empty() && lists_.empty() && yaml_file_.empty()) look_beside_pictures(take);
    if (page_) {
      for (const auto& [capture, split] : page_->split_of_capture) take(split, "images/" + split);
    }
    for (const auto& [split, list] : lists_) read_list(split, list, files);
  }

  template <class Take>
  void look_around(Take&& take) const {
    for (const std::string& split : names_in(folder_ / "images", true)) {
      take(split, "images/" + split);
    }
    for (const std::string& split : names_in(folder_, true)) {
      if (fs::is_directory(folder_ / split / "images")) take(split, split + "/images");
    }
    if (fs::is_directory(folder_ / "images")) take("", "images");
  }

  /// Without a page: lists of pictures, or labels that lie beside them.
  template <class Take>
  void look_beside_pictures(Take&& take) {
    for (const auto& [list, split] :
         {std::pair("train.txt", "train"), std::pair("valid.txt", "val"),
          std::pair("val.txt", "val"), std::pair("test.txt", "test")}) {
      std::error_code ignored;
      if (fs::is_regular_file(folder_ / list, ignored)) lists_.emplace_back(split, list);
    }
    if (!lists_.empty()) return;
    if (has_labels_beside_pictures(folder_)) take("", "");
    for (const std::string& below : names_in(folder_, true)) {
      if (has_labels_beside_pictures(folder_ / below)) take("", below);
    }
  }

  /// A file with one picture per line.
  void read_list(const std::string& split, const std::string& list, StoredFiles& files) {
    const auto text = files.text(list);
    if (!text) return;
    for (const std::string& line : text_lines(*text)) {
      if (line.empty()) continue;
      const auto place = located(line);
      files.check(place.has_value(), kMissing, list, line, "the picture is not there");
      if (!place) continue;
      const fs::path path(*place);
      const std::string pictures = with_slash(path.parent_path().generic_string());
      auto folder = std::ranges::find_if(folders_, [&](const PictureFolder& each) {
        return each.split == split && each.pictures == pictures;
      });
      if (folder == folders_.end()) {
        folders_.push_back({split, pictures, labels_beside(pictures)});
        folder = std::prev(folders_.end());
      }
      listed_.push_back({path.stem().string(), path.extension().string(),
                         std::uint32_t(folder - folders_.begin()), 0, 0});
    }
  }

  std::vector<ListedPicture> find_pictures(StoredFiles& files) {
    std::vector<ListedPicture> all = std::move(listed_);
    const bool is_listed = !all.empty();
    for (std::uint32_t i = 0; i < folders_.size() && !is_listed; ++i) {
      std::vector<ListedPicture> own = pictures_in(folder_ / folders_[i].pictures, i);
      check_labels_have_pictures(folders_[i], own, files);
      all.insert(all.end(), own.begin(), own.end());
    }
    return all;
  }

  void check_labels_have_pictures(const PictureFolder& folder,
                                  const std::vector<ListedPicture>& pictures, StoredFiles& files) {
    if (folder.labels == folder.pictures) return;
    for (const std::string& name : names_in(folder_ / folder.labels)) {
      if (!name.ends_with(".txt")) continue;
      const std::string stem = name.substr(0, name.size() - 4);
      const auto found = std::ranges::lower_bound(pictures, stem, {}, &ListedPicture::stem);
      // Names are sorted with their endings, which may put "a_1" before "a".
      const bool is_there =
          (found != pictures.end() && found->stem == stem) ||
          std::ranges::find(pictures, stem, &ListedPicture::stem) != pictures.end();
      files.check(is_there, kMissing, folder.pictures + stem, "", "the picture is missing",
                  "one beside the labels " + folder.labels + name);
    }
  }

  void choose_task(StoredFiles& files) {
    const std::string said = page_ ? page_->conventions.value("task", "") : "";
    if (said == "obb") task_ = Task::RotatedBoxes;
    if (said == "segment") task_ = Task::Polygons;
    if (said == "pose" || !yaml_.kpt_shape.empty()) task_ = Task::Keypoints;
    if (task_ == Task::Keypoints) {
      const bool is_shape = yaml_.kpt_shape.size() == 2 && yaml_.kpt_shape[0] > 0 &&
                            (yaml_.kpt_shape[1] == 2 || yaml_.kpt_shape[1] == 3);
      files.check(is_shape, kReadable, yaml_file_.empty() ? "data.yaml" : yaml_file_, "kpt_shape",
                  "is no number of points and of values each",
                  page_ ? "[9, 3]" : "for instance [17, 3]");
      if (!is_shape) yaml_.kpt_shape = {kKeypointCount, 3};
      const Json names =
          page_ ? page_->conventions.value("keypoints", Json::array()) : Json::array();
      has_named_points_ = names.is_array() && !names.empty();
      if (has_named_points_) {
        has_cuboid_points_ = names.size() == std::size_t(kKeypointCount) && names[0] == "Center";
        const std::vector<int> shape{int(names.size()), 3};
        files.check(yaml_.kpt_shape == shape, kCounts, yaml_file_, "kpt_shape",
                    "is " + std::to_string(yaml_.kpt_shape[0]) + " points",
                    "the " + std::to_string(names.size()) + " that dataset.json names");
        yaml_.kpt_shape = shape;
      }
      return;
    }
    if (said.empty()) guess_task();
  }

  /// Four points are a rotated box where every line of the dataset has four.
  void guess_task() {
    std::size_t files = 0;
    std::size_t fours = 0;
    std::size_t polygons = 0;
    for (const ListedPicture& picture : pictures_.all()) {
      if (++files > kSampledFiles) break;
      try {
        const std::string file = folders_[picture.folder].labels + picture.stem + ".txt";
        for (const std::string& line : text_lines(read_whole_file(folder_ / file))) {
          const std::size_t words = text_words(line).size();
          if (words == 9) ++fours;
          if (words >= 7 && words != 9) ++polygons;
        }
      } catch (const std::runtime_error&) {
        continue;  // Reading it is a matter of its own.
      }
    }
    if (polygons > 0) task_ = Task::Polygons;
    if (polygons == 0 && fours > 0) task_ = Task::RotatedBoxes;
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = pictures_.cameras();
    info_.captures = pictures_.captures();
    for (const auto& [id, name] : yaml_.names) info_.classes.push_back(name);
    info_.holds = {std::string(kColor.name), std::string(kHoldsInstances),
                   std::string(kHoldsLabels), std::string(kHoldsTightBoxes)};
    if (task_ == Task::Polygons) info_.holds.emplace(kInstanceId.name);
    if (task_ == Task::Keypoints) {
      info_.holds.emplace(kHoldsKeypoints);
      info_.skeletons.emplace("", skeleton());
    }
    // The extent of a rotated box reaches further than the pixels, a margin as far as one likes,
    // and people do not draw boxes along pixels.
    const bool is_loose = page_ && page_->conventions.value("box_margin", 0.0) > 0.0;
    const bool is_anywhere = task_ == Task::RotatedBoxes || is_loose;
    const double step = is_anywhere ? kAnywhere : page_ ? 0.0 : 2.0;
    info_.steps[std::string(kHoldsTightBoxes)] = step;
    // Trainers' pictures are JPEG as often as not.
    const bool is_lossy = std::ranges::any_of(
        pictures_.all(), [](const ListedPicture& picture) { return picture.ending != ".png"; });
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
  }

  /// The format has no lines; those of a box are known.
  StoredSkeleton skeleton() const {
    StoredSkeleton made;
    const Json names = page_ ? page_->conventions.value("keypoints", Json::array()) : Json::array();
    for (const Json& name : names) {
      made.names.push_back(name.is_string() ? name.get<std::string>() : name.dump());
    }
    for (int a = 1; has_cuboid_points_ && a < kKeypointCount; ++a) {
      for (int b = a + 1; b < kKeypointCount; ++b) {
        const auto& one = kCuboidKeypoints[std::size_t(a)].side;
        const auto& other = kCuboidKeypoints[std::size_t(b)].side;
        const int same = int(std::ranges::count_if(std::array{0, 1, 2}, [&](int axis) {
          return one[std::size_t(axis)] == other[std::size_t(axis)];
        }));
        if (same == 2) made.lines.emplace_back(a, b);
      }
    }
    return made;
  }

  friend class YoloPictureReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::string yaml_file_;
  DataYaml yaml_;
  std::vector<PictureFolder> folders_;
  std::vector<std::pair<std::string, std::string>> lists_;  ///< Split and file.
  std::vector<ListedPicture> listed_;
  PictureList pictures_;
  Task task_ = Task::Boxes;
  bool has_named_points_ = false;   ///< dataset.json names the keypoints.
  bool has_cuboid_points_ = false;  ///< Middle and corners of a 3-D box.
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one picture and its label lines.
class YoloPictureReading : private FrameReading {
 public:
  YoloPictureReading(const YoloDataset& dataset, const ListedPicture& picture,
                     const NameSet& wanted, ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, picture.capture,
                     dataset.pictures_.cameras()[picture.camera], wanted, log),
        dataset_(dataset),
        picture_(picture),
        folder_(dataset.folders_[picture.folder]),
        labels_(folder_.labels + picture.stem + ".txt") {}

  /// Nothing when the picture cannot be read: labels are shares of its size.
  std::optional<Frame> read(FrameSources& sources) {
    const std::string file = folder_.pictures + picture_.stem + picture_.ending;
    const auto decoded = files_.picture(file);
    if (!decoded) return std::nullopt;
    set_size(*decoded);
    if (wanted_.contains(kColor.name)) {
      frame_.set(kColor, decoded->color());
      sources.emplace(kColor.name, file);
    }
    sources.emplace(kHoldsInstances, labels_);
    // Without a page, a picture without labels is one without objects.
    if (!dataset_.page_ && !files_.has(labels_)) return std::move(frame_);
    if (const auto text = files_.text(labels_)) read_lines(*text);
    if (dataset_.task_ == Task::Polygons && wanted_.contains(kInstanceId.name)) set_ids(sources);
    return std::move(frame_);
  }

  /// By id of the object; what read() has found.
  std::map<std::uint32_t, std::vector<StoredKeypoint>> take_keypoints() {
    return std::move(keypoints_);
  }
  /// By id of the object; see StoredCapture::masks.
  std::map<std::uint32_t, CoverageMask> take_masks() { return std::move(lone_masks_); }

 private:
  void read_lines(const std::string& text) {
    if (dataset_.page_ && !text.empty()) {
      files_.check(text.back() == '\n', kReadable, labels_, "", "its last line is cut short");
    }
    std::set<std::string> seen;
    std::size_t number = 0;
    for (const std::string& line : text_lines(text)) {
      ++number;
      const std::string who = "line " + std::to_string(number);
      files_.reading(labels_, [&] {
        const std::vector<std::string> words = text_words(line);
        if (words.empty()) return;
        files_.check(seen.insert(line).second, kOnce, labels_, who, "is there a second time");
        add_object(words, who);
      });
    }
  }

  void add_object(const std::vector<std::string>& words, const std::string& who) {
    const int id = integer_of(words[0]);
    const std::vector<double> numbers = numbers_from(words, 1);
    const auto name = dataset_.yaml_.names.find(id);
    const bool is_known = name != dataset_.yaml_.names.end();
    files_.check(is_known || dataset_.yaml_.names.empty(), kIds, labels_, who,
                 "has the class " + std::to_string(id),
                 "one of the " + std::to_string(dataset_.yaml_.names.size()) + " names");
    if (!check_count(numbers, who)) return;
    check_range(numbers, who);
    Instance instance = next_instance(is_known ? name->second : std::to_string(id));
    if (numbers.size() == 4 || dataset_.task_ == Task::Keypoints) {
      instance.tight_box = box_of(numbers, who);
      if (dataset_.task_ == Task::Keypoints && dataset_.has_named_points_) {
        check_keypoints(numbers, who);
      }
      if (wants(kHoldsKeypoints)) keypoints_[instance.id] = keypoints_of(numbers);
      masks_.emplace_back();
    } else {
      add_polygon(numbers, who, instance);
    }
    frame_.instances.push_back(std::move(instance));
  }

  bool check_count(const std::vector<double>& numbers, const std::string& who) {
    const std::size_t count = numbers.size();
    bool is_good = false;
    std::string expected;
    switch (dataset_.task_) {
      case Task::Boxes:
        is_good = count == 4;
        expected = "4 of a box";
        break;
      case Task::Polygons:
        // People mix boxes in.
        is_good = (count >= 6 && count % 2 == 0) || (count == 4 && !dataset_.page_);
        expected = "pairs of a polygon";
        break;
      case Task::Keypoints: {
        const std::size_t points =
            std::size_t(dataset_.yaml_.kpt_shape[0]) * std::size_t(dataset_.yaml_.kpt_shape[1]);
        is_good = count == 4 + points;
        expected = std::to_string(4 + points) + " of a box and its key points";
        break;
      }
      case Task::RotatedBoxes:
        is_good = count == 8;
        expected = "8 of four corners";
        break;
    }
    files_.check(is_good, kReadable, labels_, who,
                 std::to_string(count) + " numbers behind the class", expected);
    return is_good;
  }

  void check_range(const std::vector<double>& numbers, const std::string& who) {
    // The corners of a rotated box may lie a little outside.
    const double slack = dataset_.task_ == Task::RotatedBoxes ? 0.5 : dataset_.page_ ? 1e-6 : 1e-3;
    const bool has_points = dataset_.task_ == Task::Keypoints;
    const std::size_t values = has_points ? std::size_t(dataset_.yaml_.kpt_shape[1]) : 2;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const bool is_flag = has_points && values == 3 && i >= 4 && (i - 4) % values == 2;
      const double high = is_flag ? 2.0 : 1.0 + slack;
      files_.check(numbers[i] >= -slack && numbers[i] <= high, kInImage, labels_, who,
                   "the value " + std::to_string(numbers[i]) + " lies outside the image");
    }
  }

  /// Middle and size in shares; edges of our own labels lie between pixels.
  PixelBox box_of(const std::vector<double>& numbers, const std::string& who) {
    const double width = frame_.camera.width;
    const double height = frame_.camera.height;
    const double left = width * (numbers[0] - 0.5 * numbers[2]);
    const double right = width * (numbers[0] + 0.5 * numbers[2]);
    const double top = height * (numbers[1] - 0.5 * numbers[3]);
    const double bottom = height * (numbers[1] + 0.5 * numbers[3]);
    const double edge = dataset_.page_ ? 2e-6 * std::max(width, height) : 1.0;
    files_.check(numbers[2] > 0.0 && numbers[3] > 0.0 && left >= -edge && top >= -edge &&
                     right <= width + edge && bottom <= height + edge,
                 kInImage, labels_, who, "its box reaches beyond the image");
    if (dataset_.page_) {
      for (const double at : {left, top, right, bottom}) {
        files_.check(std::abs(at - std::round(at)) <= 2e-6 * std::max(width, height), kBox, labels_,
                     who, "an edge of its box is at " + std::to_string(at) + " px",
                     "between two pixels");
      }
    }
    constexpr double kRounding = 0.01;
    const auto pixel = [](double at) { return int(std::clamp(at, -1e8, 1e8)); };
    return {pixel(std::floor(left + kRounding)), pixel(std::floor(top + kRounding)),
            pixel(std::ceil(right - kRounding)), pixel(std::ceil(bottom - kRounding))};
  }

  std::vector<Vec2> points_of(const std::vector<double>& numbers) const {
    std::vector<Vec2> points;
    for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
      points.emplace_back(numbers[i] * frame_.camera.width, numbers[i + 1] * frame_.camera.height);
    }
    return points;
  }

  void add_polygon(const std::vector<double>& numbers, const std::string& who, Instance& instance) {
    const std::vector<Vec2> points = points_of(numbers);
    if (dataset_.task_ == Task::RotatedBoxes) check_rectangle(points, who);
    if (dataset_.task_ == Task::Polygons && dataset_.page_) check_corners(points, who);
    CoverageMask mask = mask_of_polygons({points}, frame_.camera.width, frame_.camera.height);
    const PixelBox extent = mask.extent();
    if (dataset_.task_ == Task::Polygons) {
      files_.check(!extent.is_empty(), kPartition, labels_, who, "its polygon holds no pixel");
    }
    if (!extent.is_empty()) instance.tight_box = extent;
    masks_.push_back(dataset_.task_ == Task::Polygons ? std::move(mask) : CoverageMask());
  }

  /// Outlines of our own run between pixels.
  void check_corners(const std::vector<Vec2>& points, const std::string& who) {
    const double slack = 2e-6 * std::max(frame_.camera.width, frame_.camera.height);
    for (const Vec2& point : points) {
      const Vec2 corner(std::round(point.x()), std::round(point.y()));
      const bool is_good = (point - corner).cwiseAbs().maxCoeff() <= slack;
      files_.check(is_good, kPartition, labels_, who,
                   "a corner of its polygon is at " + std::to_string(point.x()) + ", " +
                       std::to_string(point.y()) + " px",
                   "between pixels");
      if (!is_good) return;
    }
  }

  /// The four corners are those of a rectangle, and go round it.
  void check_rectangle(const std::vector<Vec2>& p, const std::string& who) {
    const double slack =
        (dataset_.page_ ? 4e-6 : 4e-3) * std::max(frame_.camera.width, frame_.camera.height);
    const Vec2 u = p[1] - p[0];
    const Vec2 v = p[3] - p[0];
    const bool is_closed = (p[0] + p[2] - p[1] - p[3]).norm() <= slack;
    const bool is_right = std::abs(u.dot(v)) <= slack * (u.norm() + v.norm());
    files_.check(is_closed && is_right, kReadable, labels_, who,
                 "the corners of its rotated box are not those of a rectangle");
    files_.check(std::min(u.norm(), v.norm()) >= 0.5, kReadable, labels_, who,
                 "its rotated box is thinner than a pixel");
  }

  /// A keypoint in pixels; nothing for one outside of the image.
  std::optional<Vec2> keypoint(const std::vector<double>& numbers, std::size_t index) const {
    const std::size_t at = 4 + 3 * index;
    if (numbers[at + 2] == 0.0) return std::nullopt;
    return Vec2(numbers[at] * frame_.camera.width, numbers[at + 1] * frame_.camera.height);
  }

  /// Two numbers of a point are a place alone; 0, 0 is nowhere.
  std::vector<StoredKeypoint> keypoints_of(const std::vector<double>& numbers) const {
    using Sight = StoredKeypoint::Sight;
    const std::size_t values = std::size_t(dataset_.yaml_.kpt_shape[1]);
    std::vector<StoredKeypoint> points;
    for (std::size_t at = 4; at + values <= numbers.size(); at += values) {
      const Vec2 share(numbers[at], numbers[at + 1]);
      Sight sight = share.isZero() ? Sight::NotTold : Sight::Seen;
      if (values == 3) {
        const double flag = numbers[at + 2];
        sight = flag == 2.0 ? Sight::Seen : flag == 1.0 ? Sight::Hidden : Sight::NotTold;
      }
      const Vec2 pixel = share.cwiseProduct(Vec2(frame_.camera.width, frame_.camera.height));
      points.push_back({pixel, pixel.allFinite() ? sight : Sight::NotTold});
    }
    return points;
  }

  void check_keypoints(const std::vector<double>& numbers, const std::string& who) {
    Eigen::AlignedBox2d corners;
    std::size_t seen = 0;
    for (std::size_t i = 0; i < std::size_t(dataset_.yaml_.kpt_shape[0]); ++i) {
      const double flag = numbers[4 + 3 * i + 2];
      const bool is_known = flag == 0.0 || flag == 1.0 || flag == 2.0;
      const bool has_place = numbers[4 + 3 * i] != 0.0 || numbers[4 + 3 * i + 1] != 0.0;
      files_.check(is_known && (flag != 0.0 || !has_place), kInImage, labels_, who,
                   "keypoint " + std::to_string(i) + ": visibility " + std::to_string(flag) +
                       " does not fit its place");
      if (const auto point = keypoint(numbers, i)) {
        corners.extend(*point);
        ++seen;
      }
    }
    if (!dataset_.has_cuboid_points_) return;
    if (seen == std::size_t(kKeypointCount)) check_surrounded(numbers, corners, who);
    check_diagonals(numbers, who);
  }

  /// Where all corners of the 3-D box are in the image, they surround the 2-D box. Leaves a tenth
  /// for what a lens bends.
  void check_surrounded(const std::vector<double>& numbers, const Eigen::AlignedBox2d& corners,
                        const std::string& who) {
    const Vec2 size(frame_.camera.width, frame_.camera.height);
    const Vec2 middle = Vec2(numbers[0], numbers[1]).cwiseProduct(size);
    const Vec2 half = 0.5 * Vec2(numbers[2], numbers[3]).cwiseProduct(size);
    const Vec2 slack = Vec2::Ones() + 0.1 * corners.sizes();
    const bool holds = ((middle - half - corners.min() + slack).array() >= 0.0).all() &&
                       ((corners.max() + slack - middle - half).array() >= 0.0).all();
    files_.check(holds, kReproject, labels_, who,
                 "its box is not inside the extent of its keypoints");
  }

  /// The diagonals of a box meet in its middle, in every picture of it.
  void check_diagonals(const std::vector<double>& numbers, const std::string& who) {
    const auto middle = keypoint(numbers, 0);
    if (!middle) return;
    for (std::size_t corner = 1; corner <= 4; ++corner) {
      const auto a = keypoint(numbers, corner);
      const auto b = keypoint(numbers, 9 - corner);
      if (!a || !b) continue;
      const Vec2 along = *b - *a;
      const double share = (*middle - *a).dot(along) / std::max(along.squaredNorm(), 1e-12);
      const Vec2 nearest = *a + std::clamp(share, 0.0, 1.0) * along;
      files_.check((*middle - nearest).norm() <= 0.5 + 0.1 * along.norm(), kReproject, labels_, who,
                   "the diagonal of keypoints " + std::to_string(corner) + " and " +
                       std::to_string(9 - corner) + " does not meet the box's middle");
    }
  }

  void set_ids(FrameSources& sources) {
    const bool are_all_masks =
        std::ranges::none_of(masks_, [](const CoverageMask& mask) { return mask.bits.empty(); });
    PolygonParts parts(frame_.camera.width, frame_.camera.height);
    std::vector<std::uint32_t> ids;
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      parts.add(masks_[i]);
      ids.push_back(frame_.instances[i].id);
    }
    const std::int64_t contested = parts.contested();
    if (dataset_.page_) {
      files_.check(contested == 0, kPartition, labels_, "",
                   std::to_string(contested) + " pixels belong to two polygons");
    }
    if (contested > 0 || !are_all_masks) {
      for (std::size_t i = 0; i < masks_.size(); ++i) {
        if (!masks_[i].bits.empty()) lone_masks_.emplace(ids[i], std::move(masks_[i]));
      }
      return;
    }
    frame_.set(kInstanceId,
               ids_with_smaller_on_top(masks_, ids, frame_.camera.width, frame_.camera.height));
    sources.emplace(kInstanceId.name, labels_);
  }

  const YoloDataset& dataset_;
  const ListedPicture& picture_;
  const PictureFolder& folder_;
  std::string labels_;
  std::vector<CoverageMask> masks_;  ///< Of each instance; without bits for boxes.
  std::map<std::uint32_t, std::vector<StoredKeypoint>> keypoints_;
  std::map<std::uint32_t, CoverageMask> lone_masks_;
};

StoredCapture YoloDataset::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(
      info_.captures.at(i), clips_of(page_), pictures_.pictures(i),
      [&](const ListedPicture& picture, StoredCapture& stored, FrameSources& sources) {
        stored.split = folders_[picture.folder].split;
        YoloPictureReading reading(*this, picture, wanted, stored.log);
        std::optional<Frame> frame = reading.read(sources);
        const bool has_keypoints =
            wanted.contains(kHoldsKeypoints) && info_.holds.contains(kHoldsKeypoints);
        if (frame && has_keypoints) stored.keypoints.push_back(reading.take_keypoints());
        if (frame && wanted.contains(kInstanceId.name)) {
          stored.masks.push_back(reading.take_masks());
        }
        return frame;
      });
}

}  // namespace

std::vector<std::string> YoloReader::patterns() const {
  return {"*.yaml",       "*.yml",          "classes.txt",   "*.names",
          "labels/*.txt", "labels/*/*.txt", "*/labels/*.txt"};
}

Recognition YoloReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  if (fs::is_directory(folder / "images")) return Recognition::ByFiles;
  const std::string page = page_name(folder);
  if (!page.empty() && page_in(folder / page)) return Recognition::ByFiles;
  for (const std::string& split : names_in(folder, true)) {
    const bool has_both =
        fs::is_directory(folder / split / "images") && fs::is_directory(folder / split / "labels");
    if (has_both) return Recognition::ByFiles;
  }
  // Labels beside pictures, with a list of classes, so that other texts are not taken for labels.
  if (class_list_name(folder).empty()) return Recognition::No;
  if (has_labels_beside_pictures(folder)) return Recognition::ByFiles;
  for (const std::string& below : names_in(folder, true)) {
    if (has_labels_beside_pictures(folder / below)) return Recognition::ByFiles;
  }
  return Recognition::No;
}

std::unique_ptr<const StoredDataset> YoloReader::open(const fs::path& folder) const {
  return std::make_unique<YoloDataset>(folder, host_);
}

}  // namespace diorama
