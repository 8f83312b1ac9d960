// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/webdataset_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <span>

#include "diorama/error.h"
#include "reader_support/camera_json.h"
#include "reader_support/capture_rows.h"
#include "reader_support/channel_arrays.h"
#include "reader_support/clip_list.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"
#include "reader_support/listed_boxes.h"
#include "reader_support/picture_list.h"
#include "reader_support/stored_files.h"
#include "writer_webdataset/gzip_stream.h"
#include "writer_webdataset/tar_walk.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "WebDataset";
constexpr const char* kArea = "area = count";
constexpr const char* kOrder = "samples are in order";
/// More members with one name, or kinds of them, are refused: each is kept in memory.
constexpr std::size_t kMostMembers = 1'000;

bool is_shard(const std::string& name) {
  return name.ends_with(".tar") || name.ends_with(".tar.gz") || name.ends_with(".tgz");
}

struct Names {
  std::string key;     ///< With the folder in the archive.
  std::string ending;  ///< Lower case, without the first dot.
};

/// What is before and behind the first dot of a member's own name.
std::optional<Names> names_of(const std::string& member) {
  const std::size_t slash = member.rfind('/');
  const std::size_t begin = slash == member.npos ? 0 : slash + 1;
  const std::size_t dot = member.find('.', begin);
  if (dot == member.npos || dot == begin) return std::nullopt;
  std::string ending = member.substr(dot + 1);
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return char(std::tolower(c)); });
  return Names{member.substr(0, dot), std::move(ending)};
}

std::string stem_of(const std::string& key) { return key.substr(key.rfind('/') + 1); }

/// "png", or "rgb.png" where no plain one says which.
bool is_picture_of_colors(const std::string& ending) {
  const std::size_t dot = ending.rfind('.');
  if (!is_picture_ending("." + ending.substr(dot == ending.npos ? 0 : dot + 1))) return false;
  if (dot == ending.npos) return true;
  const std::string front = ending.substr(0, dot);
  constexpr std::array kFronts{"image", "img", "rgb", "color", "colors", "input"};
  return std::ranges::find(kFronts, front) != kFronts.end();
}

/// Plain names come before others.
bool is_better_picture(const std::string& a, const std::string& b) {
  const auto dots = [](const std::string& text) { return std::ranges::count(text, '.'); };
  return dots(a) != dots(b) ? dots(a) < dots(b) : a < b;
}

/// The part of a dataset that a path names; empty when it names none.
std::string split_in(const std::string& path) {
  std::string word;
  for (std::size_t i = 0; i <= path.size(); ++i) {
    const auto c = i < path.size() ? static_cast<unsigned char>(path[i]) : 0;
    if (c != 0 && std::isalpha(c)) {
      word.push_back(char(std::tolower(c)));
      continue;
    }
    if (word == "train" || word == "test" || word == "val") return word;
    if (word == "training") return "train";
    if (word == "validation" || word == "valid") return "val";
    word.clear();
  }
  return {};
}

struct Sample {
  std::uint64_t offset = 0;
  std::uint32_t shard = 0;
  std::uint32_t members = 0;
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
};

class WebDataset final : public StoredDataset {
 public:
  WebDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    for (const std::string& name : names_in(folder_)) add_shard(name);
    for (const std::string& below : names_in(folder_, true)) {
      for (const std::string& name : names_in(folder_ / below)) add_shard(below + "/" + name);
    }
    if (shards_.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no tar archives");
    }
    contents_.resize(shards_.size());
    for (std::uint32_t shard = 0; shard < shards_.size(); ++shard) scan(shard, files);
    read_lists(files);
    group(files);
    describe();
    note_clips(clips_of(page_), info_);
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  /// What a shard holds, packed or not.
  struct Content {
    std::uint64_t size = 0;
    std::optional<GzipPlaces> places;  ///< Of a packed one.
  };

  void add_shard(const std::string& path) {
    if (is_shard(path)) shards_.push_back(path);
  }

  std::ifstream open_shard(std::uint32_t shard) const {
    std::ifstream in = open_stored(folder_ / shards_[shard]);
    if (!in) throw std::runtime_error("cannot be read");
    return in;
  }

  void scan(std::uint32_t shard, StoredFiles& files) {
    const std::string& file = shards_[shard];
    ++log_.files;
    std::vector<std::uint64_t> hashes;
    files.reading(file, [&] {
      std::ifstream in = open_shard(shard);
      Content& content = contents_[shard];
      if (!is_gzip(in)) {
        content.size = fs::file_size(folder_ / file);
        scan(shard, in, content.size, hashes, files);
        return;
      }
      GzipPlaces& places = content.places.emplace(place_spacing_);
      GzipStream packed(std::move(in), places);
      try {
        scan(shard, packed, TarWalk::kAnySize, hashes, files);
        // The checksum stands at its end.
        packed.ignore(std::numeric_limits<std::streamsize>::max());
      } catch (...) {
        end_packed(content, packed.seen());
        throw;
      }
      end_packed(content, packed.seen());
    });
    std::ranges::sort(hashes);
    const auto again = std::ranges::adjacent_find(hashes);
    files.check(again == hashes.end(), kOnce, file, "", "the name of a sample comes again",
                "members of a sample follow each other");
  }

  /// Notes what was seen, and keeps the memory of all places together bounded.
  void end_packed(Content& content, std::uint64_t size) {
    content.size = size;
    place_count_ += content.places->count();
    while (place_count_ > GzipPlaces::kMost) {
      place_spacing_ *= 2;
      place_count_ = 0;
      for (Content& each : contents_) {
        if (!each.places) continue;
        each.places->thin(place_spacing_);
        place_count_ += each.places->count();
      }
    }
  }

  void scan(std::uint32_t shard, std::istream& in, std::uint64_t size,
            std::vector<std::uint64_t>& hashes, StoredFiles& files) {
    const std::string& file = shards_[shard];
    std::string key;
    TarWalk walk(in, size);
    while (const auto member = walk.next()) {
      const auto names = names_of(member->name);
      if (!names) continue;
      if (names->key != key || samples_.empty() || samples_.back().shard != shard) {
        if (page_ && !key.empty()) {
          files.check(key < names->key, kOrder, file, names->key, "stands behind " + key);
        }
        key = names->key;
        hashes.push_back(text_hash(key));
        samples_.push_back({member->header, shard, 0, 0, 0});
        number(samples_.back(), key, files);
      }
      if (++samples_.back().members > kMostMembers) {
        throw std::runtime_error(key + " has more than " + std::to_string(kMostMembers) +
                                 " members");
      }
      if (endings_.size() < kMostMembers) endings_.insert(names->ending);
    }
  }

  /// Capture and camera, as far as names say them; -1 for a sample of nobody.
  void number(Sample& sample, const std::string& key, StoredFiles& files) {
    if (!page_) {
      if (samples_.size() > std::size_t(std::numeric_limits<std::int32_t>::max())) {
        throw std::runtime_error("holds too many samples");
      }
      sample.capture = std::int32_t(samples_.size() - 1);
      return;
    }
    const auto number = capture_and_camera(*page_, stem_of(key));
    files.check(number.has_value(), kCounts, shards_[sample.shard], key,
                "is of no capture and camera that dataset.json plans");
    sample.capture = number ? number->first : -1;
    sample.camera = number ? std::uint32_t(number->second) : 0;
  }

  /// Which shards are of which part.
  void read_lists(StoredFiles& files) {
    splits_.resize(shards_.size());
    for (const char* split : {"train", "val", "test"}) {
      const std::string file = std::string(split) + ".txt";
      if (!files.has(file)) {
        files.check(!page_ || std::string(split) == "test", kMissing, file, "",
                    "the file is not there");
        continue;
      }
      const auto text = files.text(file);
      if (!text) continue;
      if (page_ && !text->empty()) {
        files.check(text->ends_with('\n'), kReadable, file, "", "its last line is cut short");
      }
      for (const std::string& line : text_lines(*text)) {
        if (line.empty()) continue;
        const auto shard = std::ranges::find(shards_, line);
        files.check(shard != shards_.end() || !page_, kMissing, line, "", "the file is not there",
                    file + " names it");
        if (shard == shards_.end()) continue;
        std::string& own = splits_[std::size_t(shard - shards_.begin())];
        files.check(own.empty(), kOnce, file, line, "is in '" + own + "' already");
        own = split;
      }
    }
    for (std::size_t i = 0; i < shards_.size(); ++i) {
      files.check(!page_ || !splits_[i].empty(), kCounts, shards_[i], "",
                  "is neither in train.txt nor in val.txt");
      if (splits_[i].empty() && !page_) splits_[i] = split_in(shards_[i]);
    }
  }

  /// Samples of one capture lie together, each camera once.
  void group(StoredFiles& files) {
    std::erase_if(samples_, [](const Sample& sample) { return sample.capture < 0; });
    rows_.set(std::move(samples_), [&](const Sample& sample, const Sample* known) {
      files.check(
          !known, kOnce, shards_[sample.shard], "",
          "capture " + std::to_string(sample.capture) + " is there a second time by one camera",
          known ? "only in " + shards_[known->shard] : "");
    });
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = page_ ? page_->cameras : std::vector<std::string>{"camera"};
    info_.captures = rows_.captures();
    if (page_) info_.classes = page_->classes;
    std::string picture;
    for (const std::string& ending : endings_) {
      if (!is_picture_of_colors(ending)) continue;
      if (picture.empty() || is_better_picture(ending, picture)) picture = ending;
    }
    if (!picture.empty()) info_.holds.emplace(kColor.name);
    const bool is_lossy = std::ranges::any_of(endings_, [](const std::string& ending) {
      return is_picture_of_colors(ending) && (ending.ends_with("jpg") || ending.ends_with("jpeg"));
    });
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
    if (endings_.contains("cls")) {
      info_.holds.insert({std::string(kHoldsInstances), std::string(kHoldsLabels)});
    }
    // What JSON says is seen by looking: a few samples from all over.
    constexpr std::size_t kLookedAt = 32;
    const auto& rows = rows_.all();
    const std::size_t step = rows.size() / kLookedAt + 1;
    if (endings_.contains("json")) {
      for (std::size_t i = 0; i < rows.size(); i += step) look_at(rows[i]);
    }
    if (has_own_json_) {
      if (endings_.contains("instances.png")) info_.holds.emplace(kInstanceId.name);
      if (endings_.contains("depth.npy")) info_.holds.emplace(kDistanceToImagePlane.name);
    }
    for (const std::string& ending : endings_) {
      if (!ending.ends_with(".npy") || ending == "depth.npy") continue;
      const std::string name = ending.substr(0, ending.size() - 4);
      if (name.find('.') != name.npos || name == kInstanceId.name) continue;
      if (!has_own_json_ && !is_geometry(name)) continue;
      channels_.insert(name);
      info_.holds.insert(name);
    }
    if (has_foreign_boxes_) info_.steps[std::string(kHoldsTightBoxes)] = 2.0;
  }

  /// Names that others may give to what they are.
  static bool is_geometry(const std::string& name) {
    return name == kDistanceToCamera.name || name == kDistanceToImagePlane.name ||
           name == kNormals.name || name == kPosition.name || name == kMotion.name;
  }

  void look_at(const Sample& sample) {
    ReadLog ignored;
    StoredFiles files(folder_, host_, ignored);
    std::map<std::string, std::string> members;
    files.reading(shards_[sample.shard], [&] {
      std::string key;
      members = load(sample, key, [](const std::string& ending) { return ending == "json"; });
      const Json json = parse_stored_json(members.at("json"));
      if (is_own(json)) {
        has_own_json_ = true;
        info_.holds.insert({std::string(kHoldsInstances), std::string(kHoldsLabels),
                            std::string(kHoldsNodePaths), std::string(kHoldsTightBoxes),
                            std::string(kHoldsCamera), std::string(kHoldsCameraPose)});
        for (const Json& object : json.at("objects")) {
          if (object.contains("world_from_node")) info_.holds.emplace(kHoldsPoses);
          if (object.contains("bounds_min")) {
            info_.holds.insert({std::string(kHoldsBounds), std::string(kHoldsBoxes3d)});
          }
          if (!object.contains("visible_share")) continue;
          info_.holds.insert({std::string(kHoldsOcclusion), std::string(kHoldsTruncation)});
        }
        return;
      }
      if (!json.is_object()) return;
      for (const ListedBox& box : boxes_of(json, {})) {
        if (!box.box && box.label.empty()) continue;
        info_.holds.emplace(kHoldsInstances);
        if (!box.label.empty()) info_.holds.emplace(kHoldsLabels);
        if (!box.box) continue;
        info_.holds.emplace(kHoldsTightBoxes);
        has_foreign_boxes_ = true;
      }
    });
  }

  static bool is_own(const Json& json) {
    return json.is_object() && json.contains("world_from_camera") && json.contains("objects") &&
           json.contains("intrinsics");
  }

  /// Objects of JSON in nobody's schema, else the class of the whole picture.
  static std::vector<ListedBox> boxes_of(const Json& json,
                                         const std::vector<std::string>& classes) {
    for (const char* key : {"objects", "annotations"}) {
      const auto found = json.find(key);
      if (found != json.end()) return listed_boxes(*found, classes);
    }
    if (json.contains("bbox") && json.at("bbox").is_array() && !json.at("bbox").empty() &&
        json.at("bbox")[0].is_array()) {
      return listed_boxes(json, classes);
    }
    for (const char* key : {"label", "class", "cls", "category"}) {
      const auto found = json.find(key);
      if (found == json.end()) continue;
      const std::string label = label_of_json(*found, classes);
      if (!label.empty()) return {{label, std::nullopt}};
    }
    return {};
  }

  /// The members that `is_wanted` by their endings; the others are there with no content.
  template <class Wanted>
  std::map<std::string, std::string> load(const Sample& sample, std::string& key,
                                          Wanted&& is_wanted) const {
    const Content& content = contents_[sample.shard];
    std::unique_ptr<std::istream> in;
    if (content.places) {
      in = std::make_unique<GzipStream>(open_shard(sample.shard), *content.places);
    } else {
      in = std::make_unique<std::ifstream>(open_shard(sample.shard));
    }
    TarWalk walk(*in, content.size, sample.offset);
    std::map<std::string, std::string> members;
    for (std::uint32_t i = 0; i < sample.members;) {
      const auto member = walk.next();
      if (!member) throw std::runtime_error("has become shorter");
      const auto names = names_of(member->name);
      if (!names) continue;
      ++i;
      key = names->key;
      std::string bytes;
      if (is_wanted(names->ending)) bytes = walk.content(*member);
      if (!members.emplace(names->ending, std::move(bytes)).second) {
        throw std::runtime_error(member->name + " is there twice");
      }
    }
    return members;
  }

  friend class SampleReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::vector<std::string> shards_;  ///< Paths in the folder.
  std::vector<Content> contents_;    ///< Of each shard.
  std::vector<std::string> splits_;  ///< Of each shard.
  std::uint64_t place_spacing_ = std::uint64_t(1) << 20;
  std::size_t place_count_ = 0;
  std::vector<Sample> samples_;  ///< While shards are scanned.
  CaptureRows<Sample> rows_;
  std::set<std::string> endings_;
  std::set<std::string> channels_;  ///< Arrays of these names are.
  bool has_own_json_ = false;
  bool has_foreign_boxes_ = false;
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one sample.
class SampleReading : private FrameReading {
 public:
  SampleReading(const WebDataset& dataset, const Sample& sample, const NameSet& wanted,
                ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, sample.capture,
                     dataset.info_.camera_names[sample.camera], wanted, log),
        dataset_(dataset),
        sample_(sample),
        file_(dataset.shards_[sample.shard]),
        log_(log) {}

  std::optional<Frame> read(FrameSources& sources) {
    ++log_.files;
    bool is_loaded = false;
    files_.reading(file_, [&] {
      members_ =
          dataset_.load(sample_, key_, [&](const std::string& ending) { return is_used(ending); });
      is_loaded = true;
    });
    if (!is_loaded) return std::nullopt;
    with("json", [&] { json_ = parse_stored_json(members_.at("json")); });
    if (!read_size()) return std::nullopt;
    read_color();
    if (is_own_) {
      with("json", [&] { read_own(); });
    } else {
      with("json", [&] { read_foreign(); });
    }
    read_class();
    read_arrays();
    check_members();
    for (const std::string& name : dataset_.info_.holds) sources.emplace(name, file_);
    return std::move(frame_);
  }

 private:
  /// Pictures tell the size, so that one is always read where JSON does not.
  bool is_used(const std::string& ending) const {
    if (ending == "json" || ending == "cls") return true;
    if (ending == "depth.npy") return wants(kDistanceToImagePlane.name);
    if (ending == "instances.png") return wants(kInstanceId.name);
    if (ending.ends_with(".npy")) {
      const std::string name = ending.substr(0, ending.size() - 4);
      return dataset_.channels_.contains(name) && wants(name);
    }
    return is_picture_of_colors(ending) && (wants(kColor.name) || !dataset_.has_own_json_);
  }

  void with(const std::string& ending, const std::function<void()>& body) {
    if (!members_.contains(ending)) return;
    try {
      body();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      files_.find(kReadable, file_, key_ + "." + ending, error.what());
    }
  }

  std::optional<StoredPicture> picture(const std::string& ending) {
    std::optional<StoredPicture> result;
    with(ending, [&] {
      const std::string& bytes = members_.at(ending);
      const std::string name = key_ + "." + ending;
      try {
        result = StoredPicture{dataset_.host_.decode_texture(
            std::as_bytes(std::span(bytes.data(), bytes.size())), name)};
      } catch (const std::exception& error) {
        // The codecs put the name in front, findings have it anyway.
        const std::string said = error.what();
        throw std::runtime_error(said.starts_with(name + ": ") ? said.substr(name.size() + 2)
                                                               : said);
      }
    });
    return result;
  }

  std::string color_ending() const {
    std::string best;
    for (const auto& [ending, content] : members_) {
      if (!is_picture_of_colors(ending)) continue;
      if (best.empty() || is_better_picture(ending, best)) best = ending;
    }
    return best;
  }

  bool read_size() {
    is_own_ = WebDataset::is_own(json_);
    if (is_own_) {
      bool is_good = false;
      with("json", [&] {
        const auto width = whole_number<std::int64_t>(json_.at("width"));
        const auto height = whole_number<std::int64_t>(json_.at("height"));
        constexpr std::int64_t kMostExtent = 1 << 20;
        if (width <= 0 || height <= 0 || width > kMostExtent || height > kMostExtent) {
          throw std::runtime_error("its size is none");
        }
        frame_.camera.width = int(width);
        frame_.camera.height = int(height);
        is_good = true;
      });
      return is_good;
    }
    const std::string ending = color_ending();
    if (ending.empty() || members_.at(ending).empty()) {
      files_.find(kMissing, file_, key_, "the sample has no picture");
      return false;
    }
    color_ = picture(ending);
    if (!color_) return false;
    set_size(*color_);
    return true;
  }

  bool has_size(const std::string& ending, int width, int height) {
    const auto text = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
    const bool fits = width == frame_.camera.width && height == frame_.camera.height;
    files_.check(fits, kCounts, file_, key_ + "." + ending, "is " + text(width, height),
                 text(frame_.camera.width, frame_.camera.height) + ", as the sample says");
    return fits;
  }

  void read_color() {
    if (!wants(kColor.name)) return;
    const std::string ending = color_ending();
    files_.check(!ending.empty(), kMissing, file_, key_, "the sample has no picture");
    if (ending.empty()) return;
    if (!color_) color_ = picture(ending);
    if (color_ && has_size(ending, color_->width(), color_->height())) {
      frame_.set(kColor, color_->color());
    }
  }

  void read_own() {
    files_.check(
        whole_number<std::int64_t>(json_.at("capture")) == sample_.capture || !dataset_.page_,
        kCounts, file_, key_, "its json says capture " + json_.at("capture").dump());
    files_.check(json_.at("camera").get<std::string>() == frame_.camera_name || !dataset_.page_,
                 kCounts, file_, key_, "its json says camera " + json_.at("camera").dump());
    if (dataset_.page_) {
      check_clip_frame(json_, dataset_.page_->clips, sample_.capture, files_, file_, key_);
    }
    frame_.camera.fx = json_.at("intrinsics").at(0).get<double>();
    frame_.camera.fy = json_.at("intrinsics").at(1).get<double>();
    frame_.camera.cx = json_.at("intrinsics").at(2).get<double>();
    frame_.camera.cy = json_.at("intrinsics").at(3).get<double>();
    require_usable(frame_.camera);
    read_lens_entry(json_, frame_.camera);
    frame_.world_from_camera = affine_of_rows(json_.at("world_from_camera"));
    std::map<std::uint32_t, std::int64_t> counts;
    if (wants(kInstanceId.name)) counts = read_masks();
    for (const Json& object : json_.at("objects")) {
      const std::string who = "object " + std::to_string(frame_.instances.size() + 1);
      // One that is damaged must not hide the others.
      Instance instance;
      instance.id = std::uint32_t(frame_.instances.size()) + 1;
      with("json", [&] { read_object(object, who, counts, instance); });
      frame_.instances.push_back(std::move(instance));
    }
  }

  /// How many pixels each value has.
  std::map<std::uint32_t, std::int64_t> read_masks() {
    std::map<std::uint32_t, std::int64_t> counts;
    const auto masks = picture("instances.png");
    if (!masks || !has_size("instances.png", masks->width(), masks->height())) return counts;
    Image<std::uint32_t> ids(masks->width(), masks->height(), 0);
    for (int y = 0; y < ids.height(); ++y) {
      for (int x = 0; x < ids.width(); ++x) {
        ids.at(x, y) = masks->at(x, y);
        ++counts[ids.at(x, y)];
      }
    }
    frame_.set(kInstanceId, std::move(ids));
    return counts;
  }

  void read_object(const Json& object, const std::string& who,
                   const std::map<std::uint32_t, std::int64_t>& counts, Instance& instance) {
    instance.node_path = object.at("node").get<std::string>();
    instance.labels["class"] = object.at("class").get<std::string>();
    const auto index = whole_number<std::int64_t>(object.at("class_index"));
    const auto& classes = dataset_.info_.classes;
    files_.check(!dataset_.page_ || (index >= 0 && std::size_t(index) < classes.size() &&
                                     classes[std::size_t(index)] == instance.labels.at("class")),
                 kIds, file_, key_ + ", " + who, "its class_index is " + std::to_string(index),
                 "the place of '" + instance.labels.at("class") + "' in the classes");
    const Json& box = object.at("box");
    const auto edge = [&](std::size_t i) {
      const auto value = whole_number<std::int64_t>(box.at(i));
      if (std::abs(value) > 100'000'000) throw std::runtime_error("a box is beyond reason");
      return int(value);
    };
    instance.tight_box = PixelBox{edge(0), edge(1), edge(2), edge(3)};
    read_pose_entry(object, instance);
    const auto visible = whole_number<std::int64_t>(object.at("visible_px"));
    if (frame_.has(kInstanceId.name)) {
      const auto found = counts.find(instance.id);
      const std::int64_t count = found == counts.end() ? 0 : found->second;
      files_.check(count == visible, kArea, file_, key_ + ", " + who,
                   "its visible_px is " + std::to_string(visible),
                   "it has " + std::to_string(count) + " pixels");
    }
    if (!object.contains("visible_share")) return;
    const double share = object.at("visible_share").get<double>();
    const double truncation = object.at("truncation").get<double>();
    files_.check(share > 0.0 && share <= 1.0, kAmodal, file_, key_ + ", " + who,
                 "its visible_share is " + std::to_string(share), "above 0, at most 1");
    files_.check(truncation >= 0.0 && truncation < 1.0, kAmodal, file_, key_ + ", " + who,
                 "its truncation is " + std::to_string(truncation), "a share below 1");
    if (!(share > 0.0 && share <= 1.0) || visible < 0) return;
    Visibility seen;
    seen.visible_pixels = visible;
    const double whole = std::min(double(visible) / share, 1e15);
    seen.amodal_pixels = std::llround(whole);
    // A share of two counts: a number near it that no counts give is wrong.
    files_.check(std::abs(whole - std::round(whole)) <= 1e-6 * whole + 1e-6, kAmodal, file_,
                 key_ + ", " + who, "its visible_share is " + std::to_string(share),
                 "a share of pixels, of which " + std::to_string(visible) + " are visible");
    if (truncation > 0.0 && truncation < 1.0) {
      seen.outside_pixels = std::llround(
          std::min(double(seen.amodal_pixels) * truncation / (1.0 - truncation), 1e15));
    }
    instance.visibility = std::move(seen);
  }

  void read_foreign() {
    if (!json_.is_object()) return;
    if (!wants(kHoldsInstances) && !wants(kHoldsLabels) && !wants(kHoldsTightBoxes)) return;
    for (const ListedBox& listed : WebDataset::boxes_of(json_, dataset_.info_.classes)) {
      if (!listed.box && listed.label.empty()) continue;
      Instance& instance = add_instance(listed.label);
      instance.tight_box = listed.box;
      if (!listed.box) continue;
      const PixelBox& box = *listed.box;
      files_.check(!box.is_empty() && box.x_min >= -1 && box.y_min >= -1 &&
                       box.x_max <= frame_.camera.width + 1 &&
                       box.y_max <= frame_.camera.height + 1,
                   kInImage, file_, key_ + ", object " + std::to_string(instance.id),
                   "its box is " + box_text(box), "a box with pixels inside the image");
    }
  }

  /// A class of the whole picture: an object without a place.
  void read_class() {
    with("cls", [&] {
      const auto words = text_lines(members_.at("cls"));
      if (words.empty() || words[0].empty()) throw std::runtime_error("names no class");
      if (!frame_.instances.empty()) return;
      add_instance(words[0]);
    });
  }

  void read_arrays() {
    for (const auto& member : members_) {
      const std::string& ending = member.first;
      const std::string& content = member.second;
      if (!ending.ends_with(".npy") || content.empty()) continue;
      with(ending, [&] {
        const StoredArray array = parse_array(content);
        const std::string name = ending.substr(0, ending.size() - 4);
        if (ending == "depth.npy" && dataset_.has_own_json_) {
          auto depth = floats_of_array(array);
          if (has_size(ending, depth.width(), depth.height())) {
            frame_.set(kDistanceToImagePlane, std::move(depth));
          }
        } else if (dataset_.channels_.contains(name)) {
          set_channel(frame_, name, array);
        }
      });
    }
  }

  /// What all samples of our own have.
  void check_members() {
    if (!dataset_.page_) return;
    files_.check(members_.contains("json"), kMissing, file_, key_ + ".json",
                 "the member is not there");
    for (const std::string& ending : dataset_.endings_) {
      if (ending != "instances.png" && !ending.ends_with(".npy")) continue;
      files_.check(members_.contains(ending), kMissing, file_, key_ + "." + ending,
                   "the member is not there", "other samples have it");
    }
  }

  const WebDataset& dataset_;
  const Sample& sample_;
  const std::string& file_;
  ReadLog& log_;
  std::string key_;
  std::map<std::string, std::string> members_;
  Json json_;
  bool is_own_ = false;
  std::optional<StoredPicture> color_;
};

StoredCapture WebDataset::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(info_.captures.at(i), clips_of(page_), rows_.of(i),
                     [&](const Sample& sample, StoredCapture& stored, FrameSources& sources) {
                       stored.split = splits_[sample.shard];
                       return SampleReading(*this, sample, wanted, stored.log).read(sources);
                     });
}

}  // namespace

std::vector<std::string> WebDatasetReader::patterns() const {
  return {"*.tar", "*/*.tar", "*.tar.gz", "*/*.tar.gz", "*.tgz", "*/*.tgz"};
}

Recognition WebDatasetReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  std::vector<fs::path> folders{folder};
  for (const std::string& below : names_in(folder, true)) folders.push_back(folder / below);
  const bool has_any = std::ranges::any_of(
      folders, [](const fs::path& each) { return std::ranges::any_of(names_in(each), is_shard); });
  return has_any ? Recognition::ByFiles : Recognition::No;
}

std::unique_ptr<const StoredDataset> WebDatasetReader::open(const fs::path& folder) const {
  return std::make_unique<WebDataset>(folder, host_);
}

}  // namespace diorama
