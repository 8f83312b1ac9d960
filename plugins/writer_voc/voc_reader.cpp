// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/voc_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <map>
#include <set>

#include "diorama/error.h"
#include "reader_support/asked_levels.h"
#include "reader_support/capture_rows.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"
#include "reader_support/picture_list.h"
#include "reader_support/split_lists.h"
#include "writer_voc/class_list_names.h"
#include "writer_voc/xml_tree.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "Pascal VOC";
constexpr const char* kAnnotations = "Annotations/";
constexpr std::uint32_t kBorder = 255;  ///< VOC's own objects have an outline of this value.

/// Value of each colour of VOC's palette: three bits of a value, red, green and blue, from the top
/// of the channels down.
const std::map<std::array<std::uint32_t, 3>, std::uint32_t>& palette() {
  static const auto values = [] {
    std::map<std::array<std::uint32_t, 3>, std::uint32_t> result;
    for (std::uint32_t value = 0; value < 256; ++value) {
      std::array<std::uint32_t, 3> color{};
      for (std::uint32_t bit = 0; bit < 8; ++bit)
        color[bit % 3] |= (value >> bit & 1u) << (7 - bit / 3);
      result.emplace(color, value);
    }
    return result;
  }();
  return values;
}

/// Values of a picture in gray or in the palette. Throws for colours that the palette lacks.
Image<std::uint32_t> values_of(const StoredPicture& picture) {
  Image<std::uint32_t> values(picture.width(), picture.height(), 0);
  const bool is_gray = picture.channels() < 3;
  for (int y = 0; y < values.height(); ++y) {
    for (int x = 0; x < values.width(); ++x) {
      if (is_gray) {
        values.at(x, y) = picture.at(x, y);
        continue;
      }
      const auto found =
          palette().find({picture.at(x, y, 0), picture.at(x, y, 1), picture.at(x, y, 2)});
      if (found == palette().end())
        throw std::runtime_error("has a colour that VOC's palette lacks");
      values.at(x, y) = found->second;
    }
  }
  return values;
}

/// Files right in the folder, which may be of any kind: some begin as annotations do.
bool has_annotations_beside_pictures(const fs::path& folder) {
  constexpr std::size_t kMostLooked = 3;
  std::size_t looked = 0;
  for (const std::string& name : names_in(folder)) {
    if (!name.ends_with(".xml")) continue;
    std::string front(4096, '\0');
    std::ifstream in = open_stored(folder / name);
    in.read(front.data(), std::streamsize(front.size()));
    if (front.find("<annotation") != front.npos) return true;
    if (++looked == kMostLooked) break;
  }
  return false;
}

std::string lines_text(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

class VocDataset final : public StoredDataset {
 public:
  VocDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    std::vector<ListedPicture> listed;
    if (!page_ && names_in(folder_ / kAnnotations).empty()) annotations_ = "";
    for (const std::string& name : names_in(folder_ / annotations_)) {
      if (name.ends_with(".xml")) listed.push_back({name.substr(0, name.size() - 4), "", 0, 0, 0});
    }
    if (listed.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no annotations of Pascal VOC");
    }
    pictures_.set(
        std::move(listed), page_,
        [&](const std::string& stem) { return capture_and_camera(*page_, stem); }, {annotations_},
        files);
    has_masks_ = fs::is_directory(folder_ / "SegmentationObject");
    read_lists(files);
    if (page_) check_own_lists(files);
    check_strays(files);
    describe();
    note_clips(clips_of(page_), info_);
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  void read_lists(StoredFiles& files) {
    split_of_ = read_split_lists(files, "ImageSets/Main", {"train", "val", "test"});
    for (const char* name : {"labels.txt", "classes.txt"}) {
      if (!files.has(name)) continue;
      if (const auto text = files.text(name)) {
        for (const std::string& line : text_lines(*text)) {
          if (!line.empty()) classes_.push_back(line);
        }
      }
      break;
    }
  }

  /// What follows from dataset.json, line by line.
  void check_own_lists(StoredFiles& files) {
    std::vector<std::string> all;
    std::map<std::string, std::vector<std::string>> splits{{"train", {}}, {"val", {}}};
    for (const auto& [capture, split] : page_->split_of_capture) {
      for (const std::string& camera : page_->cameras) {
        all.push_back(page_->stem(capture, camera));
        splits[split].push_back(all.back());
      }
    }
    const auto check_lines = [&](const std::string& file, const std::vector<std::string>& lines) {
      const auto text = files.text(file);
      if (!text) return;
      files.check(*text == lines_text(lines), kCounts, file, "",
                  "does not hold the " + std::to_string(lines.size()) +
                      " lines that follow from dataset.json");
    };
    check_lines("labels.txt", page_->classes);
    const bool has_sets = has_masks_ || fs::is_directory(folder_ / "ImageSets/Segmentation");
    for (const std::string kind : {"Main", "Segmentation"}) {
      if (kind == "Segmentation" && !has_sets) continue;
      const std::string front = "ImageSets/" + kind + "/";
      check_lines(front + "train.txt", splits["train"]);
      check_lines(front + "val.txt", splits["val"]);
      check_lines(front + "trainval.txt", all);
    }
    splits["trainval"] = all;
    check_class_lists(splits, files);
  }

  /// The lists of single classes, as far as a dataset has them: each picture with 1, 0 or -1.
  void check_class_lists(const std::map<std::string, std::vector<std::string>>& pictures,
                         StoredFiles& files) {
    const std::vector<std::string> names = class_list_names(page_->classes);
    const auto file_of = [](const std::string& name, const std::string& part) {
      return "ImageSets/Main/" + name + "_" + part + ".txt";
    };
    const bool has_any = std::ranges::any_of(names, [&](const std::string& name) {
      return std::ranges::any_of(
          pictures, [&](const auto& part) { return files.has(file_of(name, part.first)); });
    });
    if (!has_any) return;
    for (const std::string& name : names) {
      std::map<std::string, std::map<std::string, std::string>> marks;  // by stem, by part
      for (const auto& [part, stems] : pictures) {
        const std::string file = file_of(name, part);
        const auto text = files.text(file);
        if (!text) continue;
        std::vector<std::string> found;
        bool are_marked = text->empty() || text->ends_with('\n');
        for (const std::string& line : text_lines(*text)) {
          const auto words = text_words(line);
          are_marked = are_marked && words.size() == 2 &&
                       (words[1] == "1" || words[1] == "0" || words[1] == "-1");
          if (!words.empty()) found.push_back(words[0]);
          if (words.size() == 2) marks[words[0]][part] = words[1];
        }
        files.check(
            are_marked && found == stems, kCounts, file, "",
            "does not say 1, 0 or -1 of each of the " + std::to_string(stems.size()) + " pictures");
      }
      for (const auto& [stem, said] : marks) {
        const std::string& mark = said.begin()->second;
        marks_of_[stem] += mark + " ";
        for (const auto& [part, other] : said) {
          files.check(other == mark, kCounts, file_of(name, part), stem, "is marked " + other,
                      file_of(name, said.begin()->first) + " says " + mark);
        }
      }
    }
  }

  /// Pictures without an annotation: our writer leaves none.
  void check_strays(StoredFiles& files) {
    if (!page_) return;
    for (const char* below : {"JPEGImages", "SegmentationObject", "SegmentationClass"}) {
      for (const std::string& name : names_in(folder_ / below)) {
        const std::string stem = fs::path(name).stem().string();
        files.check(files.has(kAnnotations + stem + ".xml"), kMissing, kAnnotations + stem + ".xml",
                    "", "the file is not there", std::string("one for ") + below + "/" + name);
      }
    }
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = pictures_.cameras();
    info_.captures = pictures_.captures();
    info_.classes = classes_;
    info_.holds = {std::string(kColor.name), std::string(kHoldsInstances),
                   std::string(kHoldsLabels), std::string(kHoldsTightBoxes)};
    if (has_masks_) info_.holds.emplace(kInstanceId.name);
    info_.steps[kAskOcclusionLevels] = info_.steps[kAskTruncationLevels] = 1.0;
    // People draw boxes wider than objects whose outline is left out.
    info_.steps[std::string(kHoldsTightBoxes)] = page_ ? 0.0 : 12.0;
    const auto pictures = names_in(folder_ / "JPEGImages");
    const bool is_lossy = std::ranges::any_of(
        pictures, [](const std::string& name) { return !name.ends_with(".png"); });
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
  }

  friend class VocPictureReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::string annotations_ = kAnnotations;
  PictureList pictures_;
  std::map<std::string, std::string> split_of_;  ///< By stem.
  std::map<std::string, std::string> marks_of_;  ///< By stem: what the lists of the classes say.
  std::vector<std::string> classes_;
  bool has_masks_ = false;
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one annotation file.
class VocPictureReading : private FrameReading {
 public:
  VocPictureReading(const VocDataset& dataset, const ListedPicture& picture, const NameSet& wanted,
                    ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, picture.capture,
                     dataset.pictures_.cameras()[picture.camera], wanted, log),
        dataset_(dataset),
        picture_(picture),
        xml_file_(dataset.annotations_ + picture.stem + ".xml") {}

  std::optional<Frame> read(FrameSources& sources) {
    const auto text = files_.text(xml_file_);
    if (!text) return std::nullopt;
    bool is_good = false;
    files_.reading(xml_file_, [&] {
      annotation_ = parse_xml(*text);
      if (annotation_.name != "annotation") throw std::runtime_error("is no <annotation>");
      read_size();
      is_good = true;
    });
    if (!is_good) return std::nullopt;
    sources.emplace(kHoldsInstances, xml_file_);
    files_.reading(xml_file_, [&] { read_picture(sources); });
    for (const XmlElement& child : annotation_.children) {
      if (child.name == "object") files_.reading(xml_file_, [&] { add_object(child); });
    }
    check_marks();
    files_.reading(xml_file_, [&] { read_masks(sources); });
    return std::move(frame_);
  }

 private:
  void read_size() {
    const XmlElement* size = annotation_.child("size");
    if (!size && !dataset_.page_) {
      // Some tools leave it out.
      const auto picture = files_.picture(picture_file());
      if (!picture) throw std::runtime_error("has no <size>");
      return set_size(*picture);
    }
    if (!size) throw std::runtime_error("has no <size>");
    frame_.camera.width = integer_of(size->text_of("width"));
    frame_.camera.height = integer_of(size->text_of("height"));
    if (frame_.camera.width <= 0 || frame_.camera.height <= 0) {
      throw std::runtime_error("its size is none");
    }
  }

  /// The lists of the classes: 1, 0 where only difficult objects are shown, or -1.
  void check_marks() {
    const auto said = dataset_.marks_of_.find(picture_.stem);
    if (said == dataset_.marks_of_.end()) return;
    std::string expected;
    for (const std::string& name : dataset_.classes_) {
      int mark = -1;
      for (const XmlElement& object : annotation_.children) {
        const XmlElement* own = object.child("name");
        if (object.name != "object" || !own || object.text_of("name") != name) continue;
        const bool is_difficult = object.child("difficult") && object.text_of("difficult") == "1";
        mark = std::max(mark, is_difficult ? 0 : 1);
      }
      expected += std::to_string(mark) + " ";
    }
    files_.check(said->second == expected, kCounts, xml_file_, "",
                 "the lists of the classes say " + said->second, expected);
  }

  std::string picture_file() const {
    const std::string plain = fs::path(annotation_.text_of("filename")).filename().string();
    std::string file = "JPEGImages/" + plain;
    if (files_.has(file) || dataset_.page_) return file;
    for (const std::string& other : {kAnnotations + plain, "images/" + plain, plain}) {
      if (files_.has(other)) file = other;
    }
    return file;
  }

  void read_picture(FrameSources& sources) {
    const std::string name = annotation_.text_of("filename");
    const fs::path path(name);
    files_.check(!path.has_parent_path() && path.stem() == picture_.stem, kCounts, xml_file_, "",
                 "its filename is '" + name + "'", "that of a picture called " + picture_.stem);
    if (!wanted_.contains(kColor.name)) return;
    const std::string file = picture_file();
    const auto picture =
        files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, xml_file_);
    if (!picture) return;
    if (const XmlElement* size = annotation_.child("size"); size && size->child("depth")) {
      files_.check(size->text_of("depth") == std::to_string(picture->channels()), kCounts,
                   xml_file_, "", "its depth is " + size->text_of("depth"),
                   file + " has " + std::to_string(picture->channels()) + " channels");
    }
    frame_.set(kColor, picture->color());
    sources.emplace(kColor.name, file);
  }

  void add_object(const XmlElement& object) {
    const std::string name = object.text_of("name");
    Instance instance = next_instance(name);
    const std::string who = "object " + std::to_string(instance.id);
    const auto& classes = dataset_.classes_;
    files_.check(classes.empty() || std::ranges::find(classes, name) != classes.end(), kIds,
                 xml_file_, who, "is of the unknown class '" + name + "'");
    for (const char* flag : {"truncated", "occluded", "difficult"}) {
      const XmlElement* said = object.child(flag);
      if (!said) continue;
      const std::string value = object.text_of(flag);
      files_.check(value == "0" || value == "1", kReadable, xml_file_, who,
                   std::string(flag) + " is '" + value + "'", "0 or 1");
    }
    const XmlElement* box = object.child("bndbox");
    if (!box) throw std::runtime_error(who + " has no <bndbox>");
    // The format counts pixels from 1 and names the last one.
    const auto number = [&](const char* key) {
      const double value = number_of(box->text_of(key));
      files_.check(!dataset_.page_ || value == std::floor(value), kBox, xml_file_, who,
                   std::string(key) + " is " + box->text_of(key), "the number of a pixel");
      return value;
    };
    const PixelBox pixels{int(std::floor(number("xmin"))) - 1, int(std::floor(number("ymin"))) - 1,
                          int(std::ceil(number("xmax"))), int(std::ceil(number("ymax")))};
    const int slack = dataset_.page_ ? 0 : 1;
    files_.check(!pixels.is_empty() && pixels.x_min >= -slack && pixels.y_min >= -slack &&
                     pixels.x_max <= frame_.camera.width + slack &&
                     pixels.y_max <= frame_.camera.height + slack,
                 kInImage, xml_file_, who, "its box is " + box_text(pixels),
                 "a box with pixels inside the image");
    instance.tight_box = pixels;
    const auto is_set = [&](const char* flag) {
      return object.child(flag) && object.text_of(flag) == "1";
    };
    const bool tells = object.child("occluded") || object.child("truncated");
    // What is difficult is hardly seen.
    const double hidden = is_set("difficult") ? 0.9 : is_set("occluded") ? 0.25 : 0.0;
    if (tells) tell_levels(wanted_, hidden, is_set("truncated") ? 0.25 : 0.0, instance);
    frame_.instances.push_back(std::move(instance));
  }

  void read_masks(FrameSources& sources) {
    const std::string objects = "SegmentationObject/" + picture_.stem + ".png";
    const std::string classes = "SegmentationClass/" + picture_.stem + ".png";
    const XmlElement* segmented = annotation_.child("segmented");
    const bool says_so = segmented && annotation_.text_of("segmented") == "1";
    // Not every picture of other people's datasets is segmented, and few say it right.
    if (!dataset_.page_ && !files_.has(objects)) return;
    const bool is_there = files_.has(objects) || files_.has(classes);
    files_.check(!dataset_.page_ || says_so == is_there, is_there ? kCounts : kMissing,
                 is_there ? xml_file_ : objects, "",
                 says_so ? "says that it is segmented, but there are no masks"
                         : "says that it is not segmented, but there are masks");
    if (!is_there || !wanted_.contains(kInstanceId.name)) return;
    const auto size = std::pair(frame_.camera.width, frame_.camera.height);
    const auto object_picture = files_.picture_of_size(objects, size.first, size.second, xml_file_);
    const bool has_classes = dataset_.page_ || files_.has(classes);
    const auto class_picture =
        has_classes ? files_.picture_of_size(classes, size.first, size.second, xml_file_)
                    : std::nullopt;
    if (!object_picture) return;
    Image<std::uint32_t> ids;
    bool is_read = false;
    files_.reading(objects, [&] {
      ids = values_of(*object_picture);
      is_read = true;
    });
    if (!is_read) return;
    if (class_picture) {
      files_.reading(classes, [&] { check_classes(ids, values_of(*class_picture), classes); });
    }
    if (!dataset_.page_) {
      std::ranges::replace(ids.pixels(), kBorder, std::uint32_t(0));
    }
    frame_.set(kInstanceId, std::move(ids));
    sources.emplace(kInstanceId.name, objects);
  }

  /// Each object's pixels show its class, and nothing else does.
  void check_classes(const Image<std::uint32_t>& ids, const Image<std::uint32_t>& classes,
                     const std::string& file) {
    std::map<std::uint32_t, std::set<std::uint32_t>> below;
    for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
      if (dataset_.page_ || ids.pixels()[i] != kBorder) {
        below[ids.pixels()[i]].insert(classes.pixels()[i]);
      }
    }
    for (const auto& [id, values] : below) {
      files_.check(values.size() == 1, kPartition, file, "object " + std::to_string(id),
                   "shows " + std::to_string(values.size()) + " classes", "one");
      if (!dataset_.page_ || values.size() != 1) continue;
      std::uint32_t expected = 0;
      if (id != 0 && id <= frame_.instances.size()) {
        const std::string& name = frame_.instances[id - 1].labels.at("class");
        const auto place = std::ranges::find(dataset_.classes_, name);
        expected = std::uint32_t(place - dataset_.classes_.begin()) + 1;
      }
      files_.check(*values.begin() == expected, kPartition, file, "object " + std::to_string(id),
                   "has the value " + std::to_string(*values.begin()) + " on its pixels",
                   std::to_string(expected));
    }
  }

  const VocDataset& dataset_;
  const ListedPicture& picture_;
  std::string xml_file_;
  XmlElement annotation_;
};

StoredCapture VocDataset::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(
      info_.captures.at(i), clips_of(page_), pictures_.pictures(i),
      [&](const ListedPicture& picture, StoredCapture& stored, FrameSources& sources) {
        const auto split = split_of_.find(picture.stem);
        if (split != split_of_.end()) stored.split = split->second;
        return VocPictureReading(*this, picture, wanted, stored.log).read(sources);
      });
}

}  // namespace

std::vector<std::string> VocReader::patterns() const { return {"Annotations/*.xml", "*.xml"}; }

Recognition VocReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  const auto names = names_in(folder / kAnnotations);
  const bool has_any =
      std::ranges::any_of(names, [](const std::string& name) { return name.ends_with(".xml"); });
  return has_any || has_annotations_beside_pictures(folder) ? Recognition::ByFiles
                                                            : Recognition::No;
}

std::unique_ptr<const StoredDataset> VocReader::open(const fs::path& folder) const {
  return std::make_unique<VocDataset>(folder, host_);
}

}  // namespace diorama
