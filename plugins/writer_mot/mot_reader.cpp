// SPDX-License-Identifier: Apache-2.0
#include "writer_mot/mot_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "diorama/error.h"
#include "diorama/writer.h"
#include "reader_support/asked_levels.h"
#include "reader_support/capture_rows.h"
#include "reader_support/dataset_page.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "MOT Challenge";
constexpr int kMostFrames = 10'000'000;

std::vector<std::string> split_at_commas(const std::string& line) {
  std::string spaced = line;
  std::ranges::replace(spaced, ',', ' ');
  return text_words(spaced);
}

/// An object in one frame.
struct TrackLine {
  std::uint32_t track = 0;
  int number = 0;  ///< Of the class, from 1.
  std::array<double, 4> box{};
  double seen = 1.0;  ///< Share that is neither hidden nor cut off.
  std::size_t line = 0;
};

struct Sequence {
  std::string folder;  ///< "train/clip_0000_cam_0", relative.
  std::string split;
  std::string pictures = "img1";
  std::string ending = ".jpg";
  std::size_t digits = 6;  ///< Of the pictures' names.
  int length = 0;
  double fps = 30.0;
  int width = 0;  ///< 0: not said.
  int height = 0;
  std::map<int, std::vector<TrackLine>> lines;  ///< By frame, from 1.

  std::string picture(int frame) const {
    return folder + "/" + pictures + "/" + zero_padded(frame, digits) + ending;
  }
};

/// One frame of one sequence.
struct Row {
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
  std::uint32_t sequence = 0;
  std::int32_t frame = 1;
};

class MotDataset final : public StoredDataset {
 public:
  MotDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    for (const std::string& name : names_in(folder_, true)) {
      if (is_sequence(name)) add_sequence(name, "", files);
      for (const std::string& below : names_in(folder_ / name, true)) {
        if (is_sequence(name + "/" + below)) add_sequence(name + "/" + below, name, files);
      }
    }
    if (sequences_.empty()) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no sequences of MOT Challenge");
    }
    page_ ? number_own(files) : number_foreign();
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }

  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    return read_frames(info_.captures.at(i), clips_, rows_.of(i),
                       [&](const Row& row, StoredCapture& into, FrameSources& sources) {
                         into.split = sequences_[row.sequence].split;
                         return read_frame(row, wanted, into.log, sources);
                       });
  }

 private:
  bool is_sequence(const std::string& name) const {
    std::error_code ignored;
    return fs::is_regular_file(folder_ / name / "seqinfo.ini", ignored) ||
           fs::is_regular_file(folder_ / name / "gt/gt.txt", ignored);
  }

  void add_sequence(const std::string& name, const std::string& split, StoredFiles& files) {
    Sequence sequence;
    sequence.folder = name;
    sequence.split = split;
    read_page_of(sequence, files);
    if (!page_) look_at_pictures(sequence);
    read_lines(sequence, files);
    sequences_.push_back(std::move(sequence));
  }

  /// Others may number their pictures with more digits.
  void look_at_pictures(Sequence& sequence) const {
    const auto pictures = names_in(folder_ / sequence.folder / sequence.pictures);
    if (sequence.length == 0) {
      sequence.length = int(std::min<std::size_t>(pictures.size(), kMostFrames));
    }
    for (const std::string& name : pictures) {
      const fs::path path(name);
      const std::string stem = path.stem().string();
      const bool is_number = stem.find_first_not_of("0123456789") == stem.npos;
      if (path.extension() != sequence.ending || !is_number) continue;
      sequence.digits = stem.size();
      return;
    }
  }

  void read_page_of(Sequence& sequence, StoredFiles& files) {
    const std::string file = sequence.folder + "/seqinfo.ini";
    const auto text = files.text(file);
    if (!text) return;
    files.reading(file, [&] {
      std::map<std::string, std::string> values;
      for (const std::string& line : text_lines(*text)) {
        const std::size_t cut = line.find('=');
        if (cut != line.npos) values[line.substr(0, cut)] = line.substr(cut + 1);
      }
      const auto whole = [&](const char* key, int most) {
        if (!values.contains(key)) return 0;
        const int value = integer_of(values[key]);
        if (value < 1 || value > most) {
          throw std::runtime_error(std::string(key) + " is " + values[key]);
        }
        return value;
      };
      sequence.length = whole("seqLength", kMostFrames);
      sequence.width = whole("imWidth", 65535);
      sequence.height = whole("imHeight", 65535);
      if (values.contains("frameRate")) sequence.fps = number_of(values["frameRate"]);
      if (sequence.fps <= 0.0) throw std::runtime_error("frameRate is not above 0");
      // Names of folders and endings only: nothing outside of the sequence is read.
      const auto name_of = [&](const char* key, std::string& into) {
        if (!values.contains(key)) return;
        if (values[key].find('/') != std::string::npos || values[key] == "..") {
          throw std::runtime_error(std::string(key) + " is no name");
        }
        into = values[key];
      };
      name_of("imDir", sequence.pictures);
      name_of("imExt", sequence.ending);
    });
  }

  void read_lines(Sequence& sequence, StoredFiles& files) {
    const std::string file = sequence.folder + "/gt/gt.txt";
    if (!page_ && !files.has(file)) return;  // test sequences have none
    const auto text = files.text(file);
    if (!text) return;
    std::set<std::pair<int, std::uint32_t>> known;
    std::size_t number = 0;
    for (const std::string& line : text_lines(*text)) {
      ++number;
      if (line.empty()) continue;
      const std::string who = "line " + std::to_string(number);
      files.reading(file, [&] {
        const auto words = split_at_commas(line);
        if (words.size() < 7) {
          throw std::runtime_error(who + " has " + std::to_string(words.size()) + " fields, not 9");
        }
        const int frame = integer_of(words[0]);
        const int track = integer_of(words[1]);
        TrackLine object;
        object.line = number;
        // Others may count tracks from 0, which is no id.
        const int first = page_ ? 1 : 0;
        object.track = std::uint32_t(track) + std::uint32_t(1 - first);
        for (std::size_t k = 0; k < 4; ++k) object.box[k] = number_of(words[2 + k]);
        object.number = words.size() > 7 ? integer_of(words[7]) : 1;
        if (words.size() > 8) object.seen = number_of(words[8]);
        files.check(!page_ || (object.seen >= 0.0 && object.seen <= 1.0), kAmodal, file, who,
                    "its visibility is " + std::to_string(object.seen), "0 to 1");
        files.check(frame >= 1 && frame <= sequence.length, kCounts, file, who,
                    "is of frame " + words[0],
                    "1 to " + std::to_string(sequence.length) + ", as many as there are");
        files.check(known.emplace(frame, object.track).second, kOnce, file, who,
                    "the track " + words[1] + " is in frame " + words[0] + " twice");
        files.check(track >= first, kIds, file, who, "its track is " + words[1],
                    std::to_string(first) + " or more");
        if (number_of(words[6]) != 0.0 && track >= first) {
          sequence.lines[frame].push_back(object);
        }
      });
    }
  }

  /// Pages of a few bytes may tell of frames without end.
  void add_rows(int first, int count, std::uint32_t camera, std::size_t sequence,
                std::vector<Row>& rows) const {
    if (rows.size() + std::size_t(count) > std::size_t(kMostFrames)) {
      throw Error(ErrorKind::Asset, folder_.string() + ": its sequences have more than " +
                                        std::to_string(kMostFrames) + " frames in all");
    }
    for (int i = 0; i < count; ++i) {
      rows.push_back({first + i, camera, std::uint32_t(sequence), i + 1});
    }
  }

  /// The names of our own sequences say clip, or capture, and camera.
  void number_own(StoredFiles& files) {
    clips_ = page_->clips;
    cameras_ = page_->cameras;
    std::vector<Row> rows;
    for (std::size_t s = 0; s < sequences_.size(); ++s) {
      const Sequence& sequence = sequences_[s];
      const std::string name = fs::path(sequence.folder).filename().string();
      const bool is_clip = name.starts_with("clip_");
      const std::size_t begin = name.find('_') + 1;
      const std::size_t end = name.find('_', begin);
      int number = -1;
      std::uint32_t camera = 0;
      try {
        number = integer_of(name.substr(begin, end - begin));
        camera = std::uint32_t(
            std::ranges::find(cameras_, name.substr(std::min(end, name.size() - 1) + 1)) -
            cameras_.begin());
      } catch (const std::runtime_error&) {
        number = -1;
      }
      const int most = is_clip ? int(clips_.size()) : page_->captures;
      const bool is_known = number >= 0 && number < most && camera < cameras_.size();
      files.check(is_known, kIds, sequence.folder, "", "is no sequence that dataset.json tells of");
      if (!is_known) continue;
      const int first = is_clip ? clips_[std::size_t(number)].first : number;
      const int count = is_clip ? clips_[std::size_t(number)].count : 1;
      files.check(sequence.length == count, kCounts, sequence.folder + "/seqinfo.ini", "",
                  "says " + std::to_string(sequence.length) + " frames",
                  std::to_string(count) + ", as dataset.json says");
      files.check(!is_clip || sequence.fps == clips_[std::size_t(number)].fps, kCounts,
                  sequence.folder + "/seqinfo.ini", "",
                  "says " + std::to_string(sequence.fps) + " frames per second",
                  "that of dataset.json");
      const auto split = page_->split_of_capture.find(first);
      if (split != page_->split_of_capture.end()) {
        files.check(split->second == sequence.split, kCounts, sequence.folder, "",
                    "lies in " + sequence.split, split->second + ", as dataset.json says");
      }
      add_rows(first, std::min(count, sequence.length), camera, s, rows);
    }
    rows_.set(std::move(rows), [&](const Row& row, const Row* known) {
      files.check(!known, kOnce, sequences_[row.sequence].folder, "", "is there twice");
    });
    const std::size_t expected = page_->picture_count();
    files.check(rows_.all().size() == expected, kMissing, ".", "",
                "there are " + std::to_string(rows_.all().size()) + " frames",
                std::to_string(expected) + " by dataset.json");
  }

  void number_foreign() {
    cameras_ = {"camera"};
    std::vector<Row> rows;
    for (std::size_t s = 0; s < sequences_.size(); ++s) {
      if (sequences_[s].length < 1) continue;
      const int first = int(rows.size());
      add_rows(first, sequences_[s].length, 0, s, rows);
      clips_.push_back({first, sequences_[s].length, sequences_[s].fps});
    }
    rows_.set(std::move(rows), [](const Row&, const Row*) {});
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = cameras_;
    info_.captures = rows_.captures();
    if (page_) info_.classes = page_->classes;
    info_.holds = {std::string(kColor.name), std::string(kHoldsInstances),
                   std::string(kHoldsLabels), std::string(kHoldsTightBoxes)};
    info_.holds.emplace(kHoldsTracks);
    if (page_) info_.steps[kAskSeenShares] = 0.0;
    note_clips(clips_, info_);
    // The challenge's boxes were drawn round whole people.
    info_.steps[std::string(kHoldsTightBoxes)] = page_ ? 0.0 : 1e4;
    const bool is_lossy = std::ranges::any_of(
        sequences_, [](const Sequence& sequence) { return sequence.ending != ".png"; });
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
  }

  class FrameOfSequence;
  std::optional<Frame> read_frame(const Row& row, const NameSet& wanted, ReadLog& log,
                                  FrameSources& sources) const;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::vector<Sequence> sequences_;
  std::vector<DatasetClip> clips_;
  std::vector<std::string> cameras_;
  CaptureRows<Row> rows_;
  StoredInfo info_;
  ReadLog log_;
};

class MotDataset::FrameOfSequence : private FrameReading {
 public:
  FrameOfSequence(const MotDataset& dataset, const Row& row, const NameSet& wanted, ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, row.capture,
                     dataset.cameras_[row.camera], wanted, log),
        dataset_(dataset),
        sequence_(dataset.sequences_[row.sequence]),
        number_(row.frame) {}

  std::optional<Frame> read(FrameSources& sources) {
    const std::string file = sequence_.picture(number_);
    const auto picture =
        sequence_.width > 0 && sequence_.height > 0
            ? files_.picture_of_size(file, sequence_.width, sequence_.height, "seqinfo.ini")
            : files_.picture(file);
    if (!picture) return std::nullopt;
    set_size(*picture);
    if (wanted_.contains(kColor.name)) {
      frame_.set(kColor, picture->color());
      sources.emplace(kColor.name, file);
    }
    const std::string labels = sequence_.folder + "/gt/gt.txt";
    sources.emplace(kHoldsInstances, labels);
    const auto lines = sequence_.lines.find(number_);
    if (lines == sequence_.lines.end()) return std::move(frame_);
    for (const TrackLine& line : lines->second) add(line, labels);
    return std::move(frame_);
  }

 private:
  void add(const TrackLine& line, const std::string& file) {
    const std::string who = "line " + std::to_string(line.line);
    std::string name = "class " + std::to_string(line.number);
    if (dataset_.page_) {
      const auto& classes = dataset_.page_->classes;
      const bool is_known = line.number >= 1 && std::size_t(line.number) <= classes.size();
      files_.check(is_known, kIds, file, who, "is of the class " + std::to_string(line.number),
                   "1 to " + std::to_string(classes.size()));
      if (is_known) name = classes[std::size_t(line.number) - 1];
    }
    // Far beyond any picture: no number that fits into a box.
    for (const double value : line.box) {
      if (std::abs(value) <= 1e6) continue;
      files_.find(kInImage, file, who, "its box is beyond reason");
      return;
    }
    PixelBox box{int(std::floor(line.box[0])) - 1, int(std::floor(line.box[1])) - 1, 0, 0};
    box.x_max = int(std::ceil(line.box[0] + line.box[2])) - 1;
    box.y_max = int(std::ceil(line.box[1] + line.box[3])) - 1;
    if (dataset_.page_) {
      const bool is_inside = !box.is_empty() && box.x_min >= 0 && box.y_min >= 0 &&
                             box.x_max <= frame_.camera.width && box.y_max <= frame_.camera.height;
      files_.check(is_inside, kInImage, file, who, "its box is " + box_text(box),
                   "a box with pixels inside the image");
    }
    Instance& instance = add_instance(name);
    instance.id = line.track;
    instance.node_path = "/Assets/track_" + std::to_string(line.track);
    instance.tight_box = box;
    if (!wanted_.contains(std::string_view(kAskSeenShares))) return;
    constexpr std::int64_t kWhole = 1'000'000;
    Visibility& seen = instance.visibility.emplace();
    seen.amodal_pixels = kWhole;
    seen.visible_pixels = std::llround(std::clamp(line.seen, 0.0, 1.0) * double(kWhole));
  }

  const MotDataset& dataset_;
  const Sequence& sequence_;
  int number_;
};

std::optional<Frame> MotDataset::read_frame(const Row& row, const NameSet& wanted, ReadLog& log,
                                            FrameSources& sources) const {
  return FrameOfSequence(*this, row, wanted, log).read(sources);
}

}  // namespace

std::vector<std::string> MotReader::patterns() const {
  return {"*/gt/gt.txt", "*/*/gt/gt.txt", "*/seqinfo.ini", "*/*/seqinfo.ini"};
}

Recognition MotReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  std::error_code ignored;
  const auto is_sequence = [&](const fs::path& path) {
    return fs::is_regular_file(path / "seqinfo.ini", ignored) ||
           fs::is_regular_file(path / "gt/gt.txt", ignored);
  };
  for (const std::string& name : names_in(folder, true)) {
    if (is_sequence(folder / name)) return Recognition::ByFiles;
    for (const std::string& below : names_in(folder / name, true)) {
      if (is_sequence(folder / name / below)) return Recognition::ByFiles;
    }
  }
  return Recognition::No;
}

std::unique_ptr<const StoredDataset> MotReader::open(const fs::path& folder) const {
  return std::make_unique<MotDataset>(folder, host_);
}

}  // namespace diorama
