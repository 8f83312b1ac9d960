// SPDX-License-Identifier: Apache-2.0
#include "writer_kitti/kitti_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "reader_support/asked_levels.h"
#include "reader_support/camera_json.h"
#include "reader_support/capture_rows.h"
#include "reader_support/frame_reading.h"
#include "reader_support/label_text.h"
#include "reader_support/picture_list.h"
#include "reader_support/split_lists.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "KITTI";
constexpr const char* kTrackingFormat = "KITTI tracking";
constexpr const char* kBackProject = "depth back-projects";
constexpr const char* kAngles = "angles agree";
/// Of the tracking benchmark.
constexpr double kTrackingFps = 10.0;

/// The fields of a label line but the class.
struct KittiLabel {
  std::string name;
  double truncation = 0.0;
  double occlusion = 0.0;
  double alpha = 0.0;
  std::array<double, 4> box{};
  Vec3 size = Vec3::Zero();      ///< Length, height, width.
  Vec3 location = Vec3::Zero();  ///< Middle of the bottom face; x right, y down, z forward.
  double rotation_y = 0.0;

  bool has_box_3d() const { return (size.array() > 0.0).all(); }
  /// What the benchmark writes where it knows nothing.
  bool says_no_box_3d() const {
    return size == Vec3::Constant(-1.0) && location == Vec3::Constant(-1000.0) &&
           rotation_y == -10.0 && alpha == -10.0;
  }
};

KittiLabel label_of(const std::vector<std::string>& words) {
  if (words.size() != 15 && words.size() != 16) {
    throw std::runtime_error("a line of " + std::to_string(words.size()) + " fields, not 15 or 16");
  }
  const std::vector<double> v = numbers_from(words, 1);
  return {words[0],
          v[0],
          v[1],
          v[2],
          {v[3], v[4], v[5], v[6]},
          {v[9], v[7], v[8]},
          {v[10], v[11], v[12]},
          v[13]};
}

/// From the upright box's own space (length, height, width; the origin in the middle of the bottom
/// face) to a camera that looks along -z.
Affine camera_from_box(const KittiLabel& label) {
  Affine kitti_from_box = Affine::Identity();
  kitti_from_box.linear() = Eigen::AngleAxisd(label.rotation_y, Vec3::UnitY()).toRotationMatrix();
  kitti_from_box.translation() = label.location;
  Affine camera_from_kitti = Affine::Identity();
  camera_from_kitti.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return camera_from_kitti * kitti_from_box;
}

class KittiDataset final : public StoredDataset {
 public:
  KittiDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    has_unknown_ = !page_ || page_->conventions.contains("unknown");
    StoredFiles files(folder_, host_, log_);
    front_ = fs::is_directory(folder_ / "training") || page_ ? "training/" : "";
    is_tracking_ = recognise_page(folder_, kTrackingFormat) == Recognition::ByName ||
                   (!fs::is_directory(folder_ / front_ / "label_2") &&
                    fs::is_directory(folder_ / front_ / "label_02"));
    if (is_tracking_) {
      read_sequences(files);
      has_depth_ = fs::is_directory(folder_ / front_ / "depth_02");
      has_calibration_ = fs::is_directory(folder_ / front_ / "calib");
      describe();
      return;
    }
    std::vector<ListedPicture> listed;
    for (const std::string& name : names_in(folder_ / front_ / "label_2")) {
      if (name.ends_with(".txt")) listed.push_back({name.substr(0, name.size() - 4), "", 0, 0, 0});
    }
    if (listed.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no labels of KITTI");
    }
    pictures_.set(
        std::move(listed), page_, [&](const std::string& s) { return number_of(s); },
        {front_ + "label_2/"}, files);
    has_depth_ = fs::is_directory(folder_ / front_ / "depth_2");
    has_calibration_ = fs::is_directory(folder_ / front_ / "calib");
    is_stereo_ = page_ && page_->conventions.contains("image_3");
    split_of_ = read_split_lists(files, "ImageSets", {"train", "val"});
    if (page_) check_own_files(files);
    if (page_) check_class_order(*page_, files);
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  std::string stem(std::size_t number) const {
    const std::size_t all = std::max<std::size_t>(page_->picture_count(), 1);
    return zero_padded(int(number), std::max<std::size_t>(6, std::to_string(all - 1).size()));
  }

  /// The number is capture x cameras + camera.
  std::optional<std::pair<int, int>> number_of(const std::string& name) const {
    if (name.empty() || name.size() > 9) return std::nullopt;
    if (name.find_first_not_of("0123456789") != name.npos) return std::nullopt;
    const std::size_t number = std::stoul(name);
    const std::size_t cameras = page_->cameras.size();
    if (number >= page_->picture_count() || stem(number) != name) return std::nullopt;
    return std::pair(int(number / cameras), int(number % cameras));
  }

  void check_own_files(StoredFiles& files) {
    std::map<std::string, std::string> lists{{"train", ""}, {"val", ""}};
    std::string all;
    for (const auto& [capture, split] : page_->split_of_capture) {
      for (std::size_t camera = 0; camera < page_->cameras.size(); ++camera) {
        const std::string line = stem(std::size_t(capture) * page_->cameras.size() + camera) + "\n";
        lists[split] += line;
        all += line;
      }
    }
    lists["trainval"] = all;
    for (const auto& [split, lines] : lists) {
      const std::string file = "ImageSets/" + split + ".txt";
      if (const auto text = files.text(file)) {
        files.check(*text == lines, kCounts, file, "",
                    "does not hold the lines that follow from dataset.json");
      }
    }
    // What has no label file is in no list, so it is looked for here.
    for (const char* below : {"image_2", "image_3", "calib", "depth_2"}) {
      for (const std::string& name : names_in(folder_ / front_ / below)) {
        const std::string label = front_ + "label_2/" + fs::path(name).stem().string() + ".txt";
        files.check(files.has(label), kMissing, label, "", "the file is not there",
                    std::string("one for ") + below + "/" + name);
      }
    }
  }

  /// Sequences of the tracking benchmark: each frame is one of its pictures, and its labels are
  /// lines of one file.
  void read_sequences(StoredFiles& files) {
    std::vector<ListedPicture> listed;
    for (const std::string& name : names_in(folder_ / front_ / "label_02")) {
      if (!name.ends_with(".txt")) continue;
      const std::string sequence = name.substr(0, name.size() - 4);
      const std::string file = front_ + "label_02/" + name;
      const auto pictures = pictures_in(folder_ / front_ / "image_02" / sequence, 0);
      files.check(!pictures.empty(), kMissing, front_ + "image_02/" + sequence, "",
                  "there are no pictures", "those of " + file);
      if (!page_ && !pictures.empty()) {
        clips_.push_back({int(listed.size()), int(pictures.size()), kTrackingFps});
      }
      for (const ListedPicture& picture : pictures) {
        listed.push_back({sequence + "/" + picture.stem, picture.ending, 0, 0, 0});
      }
      read_tracks(sequence, file, pictures, files);
    }
    if (listed.empty()) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no sequences of KITTI");
    }
    if (page_) clips_ = page_->clips;
    pictures_.set(
        std::move(listed), page_, [&](const std::string& stem) { return frame_of_sequence(stem); },
        {front_ + "image_02/"}, files);
    const std::size_t expected = page_ ? page_->picture_count() : pictures_.all().size();
    files.check(pictures_.all().size() == expected, kMissing, front_ + "image_02", "",
                "there are " + std::to_string(pictures_.all().size()) + " pictures",
                std::to_string(expected) + " by dataset.json");
  }

  /// Capture and camera.
  std::optional<std::pair<int, int>> frame_of_sequence(const std::string& stem) const {
    const std::string sequence = stem.substr(0, stem.find('/'));
    const std::string frame = stem.substr(std::min(sequence.size() + 1, stem.size()));
    const auto is_number = [](const std::string& text) {
      return !text.empty() && text.size() <= 9 && text.find_first_not_of("0123456789") == text.npos;
    };
    if (!is_number(sequence) || !is_number(frame) || page_->cameras.empty()) return std::nullopt;
    const std::size_t number = std::stoul(sequence);
    const std::size_t clip = number / page_->cameras.size();
    if (clip >= page_->clips.size()) return std::nullopt;
    const int at = std::stoi(frame);
    if (at >= page_->clips[clip].count) return std::nullopt;
    return std::pair(page_->clips[clip].first + at, int(number % page_->cameras.size()));
  }

  /// Lines by picture, without frame and track, which stand beside them.
  void read_tracks(const std::string& sequence, const std::string& file,
                   const std::vector<ListedPicture>& pictures, StoredFiles& files) {
    std::map<int, std::string> frames;  // names of pictures, with as many digits as they have
    for (const ListedPicture& picture : pictures) {
      try {
        frames.emplace(integer_of(picture.stem), picture.stem);
      } catch (const std::runtime_error&) {
        files.find(kIds, front_ + "image_02/" + sequence + "/" + picture.stem, "",
                   "its name is no number");
      }
    }
    const auto text = files.text(file);
    if (!text) return;
    std::size_t number = 0;
    for (const std::string& line : text_lines(*text)) {
      ++number;
      files.reading(file, [&] {
        const std::vector<std::string> words = text_words(line);
        if (words.empty()) return;
        if (words.size() < 3) throw std::runtime_error("a line of fewer than three fields");
        const int frame = integer_of(words[0]);
        const int track = integer_of(words[1]);
        const auto picture = frames.find(frame);
        files.check(picture != frames.end(), kMissing, file, "line " + std::to_string(number),
                    "is of frame " + words[0], "one that has a picture");
        if (picture == frames.end()) return;
        std::string rest = words[2];
        for (std::size_t i = 3; i < words.size(); ++i) rest += " " + words[i];
        tracks_[sequence + "/" + picture->second].push_back({track, rest});
      });
    }
  }

  void describe() {
    info_.format = is_tracking_ ? kTrackingFormat : kFormat;
    note_clips(clips_, info_);
    if (is_tracking_) info_.holds.emplace(kHoldsTracks);
    info_.steps[kAskOcclusionLevels] = 1.0;
    info_.steps[kAskTruncationLevels] = is_tracking_ ? 1.0 : 0.005;
    if (is_stereo_) info_.steps[kAskCamerasOfPairs] = 1.0;
    info_.camera_names = pictures_.cameras();
    info_.captures = pictures_.captures();
    if (page_) info_.classes = page_->classes;
    info_.holds.insert({std::string(kColor.name), std::string(kHoldsInstances),
                        std::string(kHoldsLabels), std::string(kHoldsTightBoxes),
                        std::string(kHoldsBoxes3d)});
    if (has_calibration_) info_.holds.emplace(kHoldsCamera);
    if (has_depth_) info_.holds.emplace(kDistanceToImagePlane.name);
    info_.steps[std::string(kDistanceToImagePlane.name)] = 0.5 / 256.0;
    // The benchmark's own boxes were drawn, and fitted to points of a laser.
    info_.steps[std::string(kHoldsTightBoxes)] = page_ ? 0.0 : 3.0;
    info_.steps[std::string(kHoldsBoxes3d)] = page_ ? 5e-4 : 0.5;
    const auto pictures = names_in(folder_ / front_ / "image_2");
    const auto is_no_png = [](const std::string& name) { return !name.ends_with(".png"); };
    const bool is_lossy =
        is_tracking_ ? std::ranges::any_of(pictures_.all(), is_no_png, &ListedPicture::ending)
                     : std::ranges::any_of(pictures, is_no_png);
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
  }

  friend class KittiPictureReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::string front_;  ///< "training/" or nothing.
  PictureList pictures_;
  std::map<std::string, std::string> split_of_;  ///< By stem.
  bool has_depth_ = false;
  bool has_unknown_ = false;  ///< Labels may say that they do not know.
  bool has_calibration_ = false;
  bool is_stereo_ = false;
  bool is_tracking_ = false;
  std::vector<DatasetClip> clips_;
  /// By "0003/000024": tracks, and the rest of their lines.
  std::map<std::string, std::vector<std::pair<int, std::string>>> tracks_;
  StoredInfo info_;
  ReadLog log_;
};

/// Where the files of a frame lie.
struct KittiPaths {
  KittiPaths(const std::string& front, const std::string& stem, bool is_tracking)
      : pictures(front + (is_tracking ? "image_02/" : "image_2/") + stem),
        depth(front + (is_tracking ? "depth_02/" : "depth_2/") + stem + ".png") {
    const std::string own = is_tracking ? stem.substr(0, stem.find('/')) : stem;
    labels = front + (is_tracking ? "label_02/" : "label_2/") + own + ".txt";
    calibration = front + "calib/" + own + ".txt";
  }
  std::string pictures;  ///< Without its ending.
  std::string depth;
  std::string labels;
  std::string calibration;
};

/// Makes one frame of the files of one number.
class KittiPictureReading : private FrameReading {
 public:
  KittiPictureReading(const KittiDataset& dataset, const ListedPicture& picture,
                      const NameSet& wanted, ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, picture.capture,
                     dataset.pictures_.cameras()[picture.camera], wanted, log),
        dataset_(dataset),
        stem_(picture.stem),
        paths_(dataset.front_, stem_, dataset.is_tracking_),
        labels_(paths_.labels) {}

  std::optional<Frame> read(FrameSources& sources) {
    const std::string file = picture_file();
    files_.check(!file.empty(), kMissing, paths_.pictures, "", "the picture is missing");
    if (file.empty()) return std::nullopt;
    const auto picture = files_.picture(file);
    if (!picture) return std::nullopt;
    set_size(*picture);
    if (wanted_.contains(kColor.name)) {
      frame_.set(kColor, picture->color());
      sources.emplace(kColor.name, file);
    }
    if (dataset_.has_calibration_) read_calibration(sources);
    if (dataset_.is_stereo_) check_right_picture(file);
    if (dataset_.has_depth_ && wanted_.contains(kDistanceToImagePlane.name)) read_depth(sources);
    sources.emplace(kHoldsInstances, labels_);
    if (dataset_.is_tracking_) {
      read_track_labels();
    } else if (const auto text = files_.text(labels_)) {
      read_labels(*text);
    }
    return std::move(frame_);
  }

 private:
  std::string picture_file() const {
    for (const char* ending : {".png", ".jpg", ".jpeg"}) {
      const std::string file = paths_.pictures + ending;
      if (files_.has(file)) return file;
    }
    return {};
  }

  /// No frame: nothing but its picture is told of the camera to the right.
  void check_right_picture(const std::string& left) {
    std::string file = left;
    file.replace(file.rfind("image_2"), 7, "image_3");
    (void)files_.picture_of_size(file, frame_.camera.width, frame_.camera.height,
                                 "the picture to its left");
  }

  void read_calibration(FrameSources& sources) {
    const std::string& file = paths_.calibration;
    const auto text = files_.text(file);
    if (!text) return;
    sources.emplace(kHoldsCamera, file);
    files_.reading(file, [&] {
      bool has_camera = false;
      std::size_t lines = 0;
      Json lens = Json::object();
      for (const std::string& line : text_lines(*text)) {
        if (line.starts_with("lens_2: ")) lens["lens"] = parse_stored_json(line.substr(8));
        const std::vector<std::string> words = text_words(line);
        if (words.empty()) continue;
        ++lines;
        if (words[0] == "P3:" && words.size() == 13) shift_ = numbers_from(words, 1)[3];
        if (words[0] != "P2:") continue;
        const auto p = numbers_from(words, 1);
        if (p.size() != 12) throw std::runtime_error("P2 has not twelve numbers");
        Camera& camera = frame_.camera;
        camera.fx = p[0];
        camera.fy = p[5];
        camera.cx = p[2];
        camera.cy = p[6];
        require_usable(camera);
        // Labels are in the space of camera 0; the last column shifts them to camera 2.
        offset_ = {(p[3] - camera.cx * p[11]) / camera.fx, (p[7] - camera.cy * p[11]) / camera.fy,
                   p[11]};
        has_camera = true;
      }
      if (!has_camera) throw std::runtime_error("has no line P2");
      read_lens_entry(lens, frame_.camera);
      if (dataset_.page_) {
        check_own_calibration(*text, file);
        files_.check(lines >= 7 && text->ends_with('\n'), kReadable, file, "", "is cut short");
        files_.check(!dataset_.is_stereo_ || shift_ < 0.0, kReadable, file,
                     "P3:", "has no baseline", "a fourth number below 0");
      }
    });
  }

  /// Our writer has one camera, or two side by side, rectified, without other sensors.
  void check_own_calibration(const std::string& text, const std::string& file) {
    const Camera& camera = frame_.camera;
    const std::vector<double> projection{camera.fx, 0, camera.cx, 0, 0, camera.fy,
                                         camera.cy, 0, 0,         0, 1, 0};
    std::vector<double> right = projection;
    if (dataset_.is_stereo_) right[3] = shift_;
    const std::vector<double> none{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const std::vector<double> turn{1, 0, 0, 0, 1, 0, 0, 0, 1};
    const std::map<std::string, std::vector<double>> expected{
        {"P0:", projection},      {"P1:", right},     {"P2:", projection},
        {"P3:", right},           {"R0_rect:", turn}, {"Tr_velo_to_cam:", none},
        {"Tr_imu_to_velo:", none}};
    std::set<std::string> seen;
    for (const std::string& line : text_lines(text)) {
      const std::vector<std::string> words = text_words(line);
      if (words.empty() || words[0] == "lens_2:") continue;
      const auto known = expected.find(words[0]);
      files_.check(known != expected.end(), kReadable, file, words[0], "is no matrix of KITTI");
      if (known == expected.end()) continue;
      files_.check(seen.insert(words[0]).second, kOnce, file, words[0], "is there twice");
      files_.check(numbers_from(words, 1) == known->second, kCounts, file, words[0],
                   "is not what P2 gives");
    }
  }

  void read_depth(FrameSources& sources) {
    const std::string& file = paths_.depth;
    if (!dataset_.page_ && !files_.has(file)) return;
    const auto picture =
        files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, "the picture");
    if (!picture) return;
    Image<float> depth(picture->width(), picture->height(), std::numeric_limits<float>::infinity());
    for (int y = 0; y < depth.height(); ++y) {
      for (int x = 0; x < depth.width(); ++x) {
        const std::uint32_t value = picture->at(x, y);
        if (value != 0) depth.at(x, y) = float(value) / 256.0f;
      }
    }
    frame_.set(kDistanceToImagePlane, std::move(depth));
    sources.emplace(kDistanceToImagePlane.name, file);
  }

  void read_track_labels() {
    const auto lines = dataset_.tracks_.find(stem_);
    if (lines == dataset_.tracks_.end()) return;
    std::set<int> known;
    for (const auto& [track, line] : lines->second) {
      const std::string who = "frame " + stem_ + ", track " + std::to_string(track);
      files_.reading(labels_, [&, track = track, &line = line] {
        KittiLabel label = label_of(text_words(line));
        if (label.name == "DontCare") return;
        files_.check(track >= 0 && known.insert(track).second, kOnce, labels_, who,
                     "is there twice, or below 0");
        files_.check(label.truncation == 0.0 || label.truncation == 1.0 ||
                         label.truncation == 2.0 || is_cut_unknown(label),
                     kAmodal, labels_, who, "its truncation is " + std::to_string(label.truncation),
                     "0, 1 or 2");
        const double level = std::exchange(label.truncation, 0.0);  // not a share
        const std::size_t before = frame_.instances.size();
        add_object(label, who);
        if (frame_.instances.size() > before) {
          // None, up to half of it, more.
          tell_seen(label, level > 0.0 ? 0.5 * level - 0.25 : level, frame_.instances.back());
        }
        if (frame_.instances.size() == before || track < 0) return;
        // The benchmark counts tracks from 0, which is no id.
        Instance& instance = frame_.instances.back();
        instance.id = std::uint32_t(track) + (dataset_.page_ ? 0 : 1);
        instance.node_path = "/Assets/track_" + std::to_string(track);
      });
    }
  }

  void read_labels(const std::string& text) {
    if (dataset_.page_ && !text.empty()) {
      files_.check(text.back() == '\n', kReadable, labels_, "", "its last line is cut short");
    }
    std::size_t number = 0;
    std::set<std::string> known;
    for (const std::string& line : text_lines(text)) {
      ++number;
      files_.check(known.insert(line).second || line.empty() || line.starts_with("DontCare"), kOnce,
                   labels_, "line " + std::to_string(number), "is there twice");
      files_.reading(labels_, [&] {
        const std::vector<std::string> words = text_words(line);
        if (words.empty()) return;
        const KittiLabel label = label_of(words);
        if (label.name != "DontCare") {
          add_object(label, "line " + std::to_string(number) + ", " + label.name);
        }
      });
    }
  }

  void add_object(KittiLabel label, const std::string& who) {
    const bool is_own = dataset_.page_.has_value();
    std::string name = label.name;
    if (is_own) {
      // Fields are separated by blanks, so names lost theirs.
      const auto& classes = dataset_.page_->classes;
      const auto found = std::ranges::find_if(classes, [&](std::string each) {
        std::ranges::replace(each, ' ', '_');
        return each == name;
      });
      files_.check(found != classes.end(), kIds, labels_, who, "is of an unknown class");
      if (found != classes.end()) name = *found;
    }
    const PixelBox box{int(std::floor(label.box[0])), int(std::floor(label.box[1])),
                       int(std::ceil(label.box[2])), int(std::ceil(label.box[3]))};
    const int slack = is_own ? 0 : 1;
    const bool is_inside = !box.is_empty() && box.x_min >= -slack && box.y_min >= -slack &&
                           box.x_max <= frame_.camera.width + slack &&
                           box.y_max <= frame_.camera.height + slack;
    files_.check(is_inside, kInImage, labels_, who, "its box is " + box_text(box),
                 "a box with pixels inside the image");
    check_numbers(label, who);
    label.location += offset_;
    Instance instance = next_instance(name);
    instance.tight_box = box;
    tell_seen(label, label.truncation, instance);
    if (label.has_box_3d()) {
      const Vec3 half = 0.5 * label.size;
      instance.world_from_node = camera_from_box(label);
      instance.bounds_node.min = {-half.x(), -label.size.y(), -half.z()};
      instance.bounds_node.max = {half.x(), 0.0, half.z()};
      if (is_inside && is_own) check_sides(instance, who);
    }
    frame_.instances.push_back(std::move(instance));
  }

  /// Who does not know how much is cut off does not know how much is hidden either.
  bool is_cut_unknown(const KittiLabel& label) const {
    return dataset_.has_unknown_ && label.truncation == -1.0 && label.occlusion == 3.0;
  }

  /// Level 1 is partly hidden, 2 largely; of other ones nothing is known.
  void tell_seen(const KittiLabel& label, double cut_off, Instance& instance) {
    const double& level = label.occlusion;
    if (!(level >= 0.0 && level <= 2.0) || cut_off < 0.0) return;
    tell_levels(wanted_, level > 0.0 ? 0.5 * level - 0.25 : 0.0, cut_off, instance);
  }

  void check_numbers(const KittiLabel& label, const std::string& who) {
    files_.check((label.truncation >= 0.0 && label.truncation <= 1.0) || is_cut_unknown(label),
                 kAmodal, labels_, who, "its truncation is " + std::to_string(label.truncation),
                 "0 to 1");
    // To two digits, also where a last pixel is left in a corner.
    const bool is_at_border = label.box[0] <= 0.0 || label.box[1] <= 0.0 ||
                              label.box[2] >= frame_.camera.width ||
                              label.box[3] >= frame_.camera.height;
    files_.check(!dataset_.page_ || label.truncation < 1.0 || is_at_border, kAmodal, labels_, who,
                 "nothing of it is inside the image, and its box does not touch the border");
    const bool is_level = label.occlusion == 0.0 || label.occlusion == 1.0 ||
                          label.occlusion == 2.0 || label.occlusion == 3.0;
    files_.check(is_level && (dataset_.has_unknown_ || label.occlusion != 3.0), kAmodal, labels_,
                 who, "its occlusion is " + std::to_string(label.occlusion),
                 "0, 1, 2 or, unknown, 3");
    if (label.says_no_box_3d()) return;
    files_.check(std::abs(label.rotation_y) <= kPi + 0.01 && std::abs(label.alpha) <= kPi + 0.01,
                 kAngles, labels_, who, "an angle is beyond pi");
    if (!label.has_box_3d()) {
      // Others write zeros where they have no box.
      files_.check(dataset_.has_unknown_ && (label.size.array() <= 0.0).all(), kReadable, labels_,
                   who, "its 3-D box has no size");
      return;
    }
    // The benchmark's own angles were made of another point of the box.
    const double slack = dataset_.page_ ? 0.0052 : 0.3;
    const double bearing = std::atan2(label.location.x(), label.location.z());
    const double expected = std::remainder(label.rotation_y - bearing, 2.0 * kPi);
    files_.check(std::abs(std::remainder(label.alpha - expected, 2.0 * kPi)) <= slack, kAngles,
                 labels_, who, "its alpha is " + std::to_string(label.alpha),
                 std::to_string(expected) + ", by rotation and place");
  }

  /// Each side of the 2-D box touches the object: by the depth, some pixel of its outermost row or
  /// column lies in the 3-D box.
  void check_sides(const Instance& instance, const std::string& who) {
    if (!frame_.has(kDistanceToImagePlane.name)) return;
    const auto& depth = frame_.get(kDistanceToImagePlane);
    const Affine box_from_camera = instance.world_from_node.inverse();
    const Aabb& bounds = instance.bounds_node;
    const Vec3 slack = Vec3::Constant(0.01) + 0.01 * bounds.size();
    const auto is_met = [&](int x, int y) {
      const auto ray = ray_direction(frame_.camera, Vec2(x + 0.5, y + 0.5));
      if (!ray || ray->z() >= 0.0 || !std::isfinite(depth.at(x, y))) return false;
      const Vec3 p = box_from_camera * (*ray * (double(depth.at(x, y)) / -ray->z()));
      return ((p - bounds.min + slack).array() >= 0.0).all() &&
             ((bounds.max + slack - p).array() >= 0.0).all();
    };
    const PixelBox& b = *instance.tight_box;
    std::array<bool, 4> touches{};
    for (int x = b.x_min; x < b.x_max; ++x) {
      touches[0] |= is_met(x, b.y_min);
      touches[1] |= is_met(x, b.y_max - 1);
    }
    for (int y = b.y_min; y < b.y_max; ++y) {
      touches[2] |= is_met(b.x_min, y);
      touches[3] |= is_met(b.x_max - 1, y);
    }
    files_.check(
        touches[0] && touches[1] && touches[2] && touches[3], kBackProject, labels_, who,
        "by the depth, a side of its 2-D box " + box_text(b) + " does not touch its 3-D box");
  }

  const KittiDataset& dataset_;
  std::string stem_;
  KittiPaths paths_;
  std::string labels_;
  Vec3 offset_ = Vec3::Zero();  ///< Of camera 0 in the space of camera 2.
  double shift_ = 0.0;          ///< Of P3: -fx x baseline.
};

StoredCapture KittiDataset::read(std::size_t i, const NameSet& wanted) const {
  StoredCapture read =
      read_frames(info_.captures.at(i), clips_, pictures_.pictures(i),
                  [&](const ListedPicture& picture, StoredCapture& stored, FrameSources& sources) {
                    const auto split = split_of_.find(picture.stem);
                    if (split != split_of_.end()) stored.split = split->second;
                    return KittiPictureReading(*this, picture, wanted, stored.log).read(sources);
                  });
  if (!is_tracking_ || !page_) return read;
  const auto split = page_->split_of_capture.find(read.capture.index);
  if (split != page_->split_of_capture.end()) read.split = split->second;
  return read;
}

}  // namespace

std::vector<std::string> KittiReader::patterns() const {
  return {"training/label_2/*.txt", "label_2/*.txt", "training/label_02/*.txt", "label_02/*.txt"};
}

Recognition KittiReader::recognise(const fs::path& folder) const {
  for (const char* format : {kFormat, kTrackingFormat}) {
    if (recognise_page(folder, format) == Recognition::ByName) return Recognition::ByName;
  }
  for (const char* place : {"training/label_2", "label_2", "training/label_02", "label_02"}) {
    const auto names = names_in(folder / place);
    if (std::ranges::any_of(names, [](const std::string& n) { return n.ends_with(".txt"); })) {
      return Recognition::ByFiles;
    }
  }
  return Recognition::No;
}

std::unique_ptr<const StoredDataset> KittiReader::open(const fs::path& folder) const {
  return std::make_unique<KittiDataset>(folder, host_);
}

}  // namespace diorama
