// SPDX-License-Identifier: Apache-2.0
#include "writer_imagefolder/image_folder_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "diorama/error.h"
#include "reader_support/capture_rows.h"
#include "reader_support/clip_list.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"
#include "reader_support/listed_boxes.h"
#include "reader_support/picture_list.h"
#include "writer_imagefolder/metadata_lines.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "Hugging Face image folder";
constexpr const char* kTables[] = {"metadata.jsonl", "metadata.csv"};

/// The library's name of a split; empty for other folders.
std::string split_of(const std::string& folder) {
  if (folder == "train" || folder == "training") return "train";
  if (folder == "validation" || folder == "valid" || folder == "val" || folder == "dev")
    return "val";
  if (folder == "test" || folder == "testing" || folder == "eval") return "test";
  return {};
}

bool is_csv(const std::string& table) { return table.ends_with(".csv"); }

/// A row of metadata, or a picture in the folder of its class.
struct Entry {
  std::uint32_t table = 0;  ///< Place in the list of tables, or of class folders.
  RowSpan row;
  std::string picture;  ///< In its class folder; empty for rows.
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
};

struct Table {
  std::string folder;  ///< With a '/' behind; empty: the dataset's own.
  std::string name;    ///< Empty: the folder of a class.
  std::string split;
  std::string label;                 ///< Of a class folder.
  std::vector<std::string> columns;  ///< Of .csv.

  std::string path() const { return folder + name; }
};

/// True for a folder in which there are pictures and nothing else. Those of render products are
/// none of classes.
bool may_be_class(const fs::path& folder) {
  if (folder.filename().string().starts_with("rp_")) return false;
  const auto names = names_in(folder);
  return !names.empty() && names_in(folder, true).empty() &&
         std::ranges::all_of(names, [](const std::string& name) {
           return is_picture_ending(fs::path(name).extension().string()) || name.starts_with('.');
         });
}

/// Folders of classes right below; none unless all folders are such, and two at least.
std::vector<std::string> class_folders(const fs::path& folder) {
  const auto below = names_in(folder, true);
  const bool are_classes = below.size() >= 2 && std::ranges::all_of(below, [&](const auto& name) {
                             return may_be_class(folder / name);
                           });
  return are_classes ? below : std::vector<std::string>();
}

/// Files that people put beside class folders.
bool is_page(const std::string& name) {
  return name.starts_with("README") || name.starts_with("LICENSE") || name.starts_with('.') ||
         name == "dataset_infos.json" || name == "dataset_dict.json";
}

/// Tables with rows, else folders of classes.
std::vector<Table> find_tables(const fs::path& folder) {
  std::vector<Table> tables;
  std::error_code ignored;
  const auto add_table = [&](const std::string& below) {
    for (const char* name : kTables) {
      if (!fs::is_regular_file(folder / below / name, ignored)) continue;
      const std::string plain = below.empty() ? "" : below.substr(0, below.size() - 1);
      tables.push_back({below, name, split_of(plain), "", {}});
      return;
    }
  };
  add_table("");
  for (const std::string& below : names_in(folder, true)) add_table(below + "/");
  if (!tables.empty()) return tables;
  const auto pages = names_in(folder);
  if (!std::ranges::all_of(pages, is_page)) return tables;
  const auto add_classes = [&](const std::string& below, const std::string& split) {
    for (const std::string& label : class_folders(folder / below)) {
      tables.push_back({below + label + "/", "", split, label, {}});
    }
  };
  const auto below = names_in(folder, true);
  const bool are_splits = !below.empty() && std::ranges::all_of(below, [](const std::string& name) {
    return !split_of(name).empty();
  });
  if (!are_splits) {
    add_classes("", "");
    return tables;
  }
  for (const std::string& split : below) add_classes(split + "/", split_of(split));
  return tables;
}

class ImageFolder final : public StoredDataset {
 public:
  ImageFolder(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    tables_ = find_tables(folder_);
    if (tables_.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no metadata and no classes");
    }
    if (page_) classes_ = page_->classes;
    StoredFiles files(folder_, host_, log_);
    if (page_) check_splits(files);
    for (std::uint32_t i = 0; i < tables_.size(); ++i) {
      if (tables_[i].name.empty()) {
        list_class(i);
      } else {
        list_rows(i, files);
      }
    }
    group(files);
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  void check_splits(StoredFiles& files) {
    std::set<std::string> splits;
    for (const auto& [capture, split] : page_->split_of_capture) splits.insert(split);
    for (const std::string& split : splits) {
      const std::string table = (split == "val" ? "validation" : split) + "/metadata.jsonl";
      files.check(files.has(table), kMissing, table, "", "the file is not there");
    }
    const auto card = files.text("README.md");
    if (!card) return;
    std::size_t number = 0;
    for (const std::string& name : page_->classes) {
      const std::string line = "\n" + std::to_string(number++) + ". " + name + "\n";
      files.check(card->find(line) != card->npos, kIds, "README.md", "class '" + name + "'",
                  "is not there with its number");
    }
  }

  void list_class(std::uint32_t place) {
    const Table& table = tables_[place];
    if (std::ranges::find(classes_, table.label) == classes_.end()) {
      classes_.push_back(table.label);
    }
    for (const ListedPicture& picture : pictures_in(folder_ / table.folder, place)) {
      entries_.push_back({place, {}, picture.stem + picture.ending, 0, 0});
    }
  }

  Json row_json(const Table& table, const std::string& row) const {
    const Json json = is_csv(table.name) ? json_of_csv(table.columns, row) : parse_stored_json(row);
    if (!json.is_object()) throw std::runtime_error("a row is no JSON object");
    return json;
  }

  static std::string file_name(const Json& row) {
    const auto name = row.find("file_name");
    if (name != row.end() && name->is_string()) return name->get<std::string>();
    for (const auto& [key, value] : row.items()) {
      if (key.ends_with("_file_name") && value.is_string()) return value.get<std::string>();
    }
    throw std::runtime_error("a row has no file_name");
  }

  void list_rows(std::uint32_t place, StoredFiles& files) {
    Table& table = tables_[place];
    const std::string path = table.path();
    ++log_.files;
    std::set<std::uint64_t> known;
    std::size_t number = 0;
    files.reading(path, [&] {
      visit_rows(folder_ / path, is_csv(table.name), [&](RowSpan span, const std::string& row) {
        if (is_csv(table.name) && table.columns.empty()) {
          table.columns = csv_fields(row);
          return;
        }
        const std::string who = "row " + std::to_string(++number);
        files.reading(path, [&] {
          const Json json = row_json(table, row);
          const std::string name = file_name(json);
          files.check(known.insert(text_hash(name)).second, kOnce, path, who,
                      "'" + name + "' is there a second time");
          Entry entry{place, span, "", 0, 0};
          if (page_) {
            const auto found = capture_and_camera(*page_, fs::path(name).stem().string());
            files.check(found.has_value(), kCounts, path, who,
                        "'" + name + "' is of no capture and camera that dataset.json plans");
            if (!found) return;
            entry.capture = found->first;
            entry.camera = std::uint32_t(found->second);
          }
          entries_.push_back(std::move(entry));
        });
      });
    });
    for (const ListedPicture& picture : pictures_in(folder_ / table.folder, 0)) {
      const std::string name = picture.stem + picture.ending;
      files.check(known.contains(text_hash(name)), kMissing, path, name, "the picture has no row");
    }
  }

  void group(StoredFiles& files) {
    if (!page_) {
      for (std::size_t i = 0; i < entries_.size(); ++i) entries_[i].capture = std::int32_t(i);
    }
    rows_.set(std::move(entries_), [&](const Entry& entry, const Entry* known) {
      files.check(!known, kOnce, tables_[entry.table].path(),
                  "capture " + std::to_string(entry.capture),
                  "is there a second time by one camera");
    });
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = page_ ? page_->cameras : std::vector<std::string>{"camera"};
    info_.captures = rows_.captures();
    info_.classes = classes_;
    info_.holds = {std::string(kColor.name)};
    bool is_lossy = false;
    constexpr std::size_t kLookedAt = 32;
    const auto& rows = rows_.all();
    const std::size_t step = rows.size() / kLookedAt + 1;
    for (std::size_t i = 0; i < rows.size(); i += step) look_at(rows[i], is_lossy);
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
    info_.steps[std::string(kHoldsTightBoxes)] = page_ ? 0.0 : 2.0;
    info_.steps[std::string(kHoldsOcclusion)] = 1e-6;
    note_clips(clips_of(page_), info_);
  }

  void look_at(const Entry& entry, bool& is_lossy) {
    const Table& table = tables_[entry.table];
    std::string name = entry.picture;
    try {
      if (!table.name.empty()) {
        const Json row = row_json(table, read_row(folder_ / table.path(), entry.row));
        name = file_name(row);
        for (const ListedBox& box : boxes_of(row)) {
          info_.holds.emplace(kHoldsInstances);
          if (!box.label.empty()) info_.holds.emplace(kHoldsLabels);
          if (box.box) info_.holds.emplace(kHoldsTightBoxes);
        }
        const auto objects = row.find("objects");
        if (objects != row.end() && objects->is_object() && objects->contains("visible_share")) {
          info_.holds.emplace(kHoldsOcclusion);
        }
      } else {
        info_.holds.insert({std::string(kHoldsInstances), std::string(kHoldsLabels)});
      }
    } catch (const std::exception&) {
      return;
    }
    is_lossy = is_lossy || !name.ends_with(".png");
  }

  std::vector<ListedBox> boxes_of(const Json& row) const {
    const auto objects = row.find("objects");
    if (objects != row.end()) return listed_boxes(*objects, classes_);
    for (const char* key : {"label", "labels", "class", "category"}) {
      const auto value = row.find(key);
      if (value == row.end()) continue;
      const std::string label = label_of_json(*value, classes_);
      if (!label.empty()) return {{label, std::nullopt}};
    }
    return {};
  }

  friend class ImageFolderReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::vector<Table> tables_;
  std::vector<Entry> entries_;  ///< While tables are listed.
  CaptureRows<Entry> rows_;
  std::vector<std::string> classes_;
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of a row, or of a picture in the folder of its class.
class ImageFolderReading : private FrameReading {
 public:
  ImageFolderReading(const ImageFolder& dataset, const Entry& entry, const NameSet& wanted,
                     ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, entry.capture,
                     dataset.info_.camera_names[entry.camera], wanted, log),
        dataset_(dataset),
        entry_(entry),
        table_(dataset.tables_[entry.table]) {}

  std::optional<Frame> read(FrameSources& sources) {
    std::string file = table_.folder + entry_.picture;
    bool is_good = true;
    if (!table_.name.empty()) {
      is_good = false;
      files_.reading(table_.path(), [&] {
        row_ = dataset_.row_json(table_, read_row(dataset_.folder_ / table_.path(), entry_.row));
        const fs::path name = fs::path(ImageFolder::file_name(row_)).lexically_normal();
        if (name.is_absolute() || name.empty() || *name.begin() == "..") {
          throw std::runtime_error("'" + name.string() + "' lies outside of the dataset");
        }
        file = table_.folder + name.generic_string();
        is_good = true;
      });
    }
    if (!is_good) return std::nullopt;
    const auto picture = files_.picture(file);
    if (!picture) return std::nullopt;
    set_size(*picture);
    if (wanted_.contains(kColor.name)) {
      frame_.set(kColor, picture->color());
      sources.emplace(kColor.name, file);
    }
    sources.emplace(kHoldsInstances, table_.name.empty() ? file : table_.path());
    if (table_.name.empty()) {
      add_instance(table_.label);
    } else {
      files_.reading(table_.path(), [&] { read_row_objects(file); });
    }
    return std::move(frame_);
  }

 private:
  void read_row_objects(const std::string& file) {
    check_row(file);
    const auto objects = row_.find("objects");
    const bool has_shares = objects != row_.end() && objects->is_object() &&
                            objects->contains("visible_share") && objects->contains("area");
    std::size_t place = 0;
    for (const ListedBox& listed : dataset_.boxes_of(row_)) {
      Instance& instance = add_instance(listed.label);
      instance.tight_box = listed.box;
      const std::string who = file + ", object " + std::to_string(place);
      if (dataset_.page_) {
        const auto& classes = dataset_.classes_;
        files_.check(std::ranges::find(classes, listed.label) != classes.end(), kIds, table_.path(),
                     who, "its category '" + listed.label + "' is none");
      }
      if (listed.box) check_box(*listed.box, who);
      if (has_shares) {
        read_share(objects->at("area").at(place), objects->at("visible_share").at(place), who,
                   instance);
      }
      ++place;
    }
  }

  void check_row(const std::string& file) {
    const auto said = [&](const char* key, int expected) {
      const auto value = row_.find(key);
      if (value == row_.end() || !value->is_number()) return;
      files_.check(value->get<double>() == double(expected), kCounts, table_.path(), file,
                   std::string("its ") + key + " is " + value->dump(), std::to_string(expected));
    };
    if (!dataset_.page_) return;
    said("width", frame_.camera.width);
    said("height", frame_.camera.height);
    said("capture", entry_.capture);
    check_clip_frame(row_, dataset_.page_->clips, entry_.capture, files_, table_.path(), file);
    said("image_id", entry_.capture * int(dataset_.page_->cameras.size()) + int(entry_.camera));
    const auto camera = row_.find("camera");
    files_.check(camera != row_.end() && *camera == frame_.camera_name, kCounts, table_.path(),
                 file, "its camera is " + (camera == row_.end() ? "none" : camera->dump()),
                 frame_.camera_name);
    const auto objects = row_.find("objects");
    if (objects == row_.end() || !objects->contains("id")) return;
    std::set<std::int64_t> ids;
    for (const Json& id : objects->at("id")) {
      files_.check(ids.insert(whole_number<std::int64_t>(id)).second, kOnce, table_.path(), file,
                   "the id " + id.dump() + " is there twice");
    }
  }

  void check_box(const PixelBox& box, const std::string& who) {
    const int slack = dataset_.page_ ? 0 : 1;
    files_.check(!box.is_empty() && box.x_min >= -slack && box.y_min >= -slack &&
                     box.x_max <= frame_.camera.width + slack &&
                     box.y_max <= frame_.camera.height + slack,
                 kInImage, table_.path(), who, "its box is " + box_text(box),
                 "a box with pixels inside the image");
  }

  void read_share(const Json& area, const Json& share, const std::string& who, Instance& instance) {
    const auto visible = whole_number<std::int64_t>(area);
    const double visible_share = share.get<double>();
    const auto box = instance.tight_box;
    files_.check(
        visible > 0 && box && visible <= std::int64_t(box->width()) * std::int64_t(box->height()),
        kAmodal, table_.path(), who, "its area is " + std::to_string(visible),
        "above 0, at most that of its box");
    files_.check(visible_share > 0.0 && visible_share <= 1.0, kAmodal, table_.path(), who,
                 "its visible_share is " + std::to_string(visible_share), "above 0, at most 1");
    if (visible <= 0 || !(visible_share > 0.0 && visible_share <= 1.0)) return;
    Visibility seen;
    seen.visible_pixels = visible;
    seen.amodal_pixels = std::llround(std::min(double(visible) / visible_share, 1e15));
    instance.visibility = std::move(seen);
  }

  const ImageFolder& dataset_;
  const Entry& entry_;
  const Table& table_;
  Json row_;
};

StoredCapture ImageFolder::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(info_.captures.at(i), clips_of(page_), rows_.of(i),
                     [&](const Entry& entry, StoredCapture& stored, FrameSources& sources) {
                       stored.split = tables_[entry.table].split;
                       return ImageFolderReading(*this, entry, wanted, stored.log).read(sources);
                     });
}

}  // namespace

std::vector<std::string> ImageFolderReader::patterns() const {
  return {"metadata.jsonl", "metadata.csv", "*/metadata.jsonl", "*/metadata.csv", "*/*.png",
          "*/*.jpg",        "*/*.jpeg",     "*/*/*.png",        "*/*/*.jpg",      "*/*/*.jpeg"};
}

Recognition ImageFolderReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  return find_tables(folder).empty() ? Recognition::No : Recognition::ByFiles;
}

std::unique_ptr<const StoredDataset> ImageFolderReader::open(const fs::path& folder) const {
  return std::make_unique<ImageFolder>(folder, host_);
}

}  // namespace diorama
