// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include <span>
#include "diorama/error.h"
#include "reader_support/capture_rows.h"
#include "reader_support/clip_list.h"
#include "reader_support/dataset_page.h"
#include "reader_support/frame_reading.h"
#include "reader_support/picture_list.h"
#include "writer_pose/pose_entry.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "PoseWriter";
constexpr const char* kProject = "keypoints project onto their pixels";
constexpr const char* kPose = "pose agrees with the keypoints";
constexpr std::string_view kProduct = "rp_";
constexpr std::string_view kOverlays = "overlay";  ///< Drawings: read, and nothing in a frame.
/// Files that are looked at before it is decided by whose rules poses are.
constexpr std::size_t kLookedAt = 16;

/// Cameras that take turns in the folder; empty when metadata.txt does not say.
std::vector<std::string> said_cameras(const fs::path& folder) {
  const Json json = metadata_page(folder);
  const auto cameras = json.find("cameras");
  const bool are_names = cameras != json.end() && cameras->is_array() &&
                         std::ranges::all_of(*cameras, [](const Json& c) { return c.is_string(); });
  return are_names ? cameras->get<std::vector<std::string>>() : std::vector<std::string>();
}

/// What the page of the run says that a folder is of.
struct RunPage {
  std::vector<std::string> cameras;
  int captures = 0;
  std::vector<DatasetClip> clips;
};

std::optional<RunPage> page_of_run(const fs::path& folder) {
  for (const fs::path& place : {folder, folder / "..", folder / "../.."}) {
    try {
      const Json page =
          parse_stored_json(read_whole_file(place / "dataset.json", std::uintmax_t(256) << 20));
      if (!page.is_object() || !page.contains("writers") || !page.contains("cameras")) continue;
      RunPage run{page.at("cameras").get<std::vector<std::string>>(),
                  whole_number<int>(page.at("captures")),
                  clips_of_json(page.value("clips", Json::array()))};
      constexpr int kMostCaptures = 10'000'000;
      if (run.cameras.empty() || run.captures < 0 || run.captures > kMostCaptures) continue;
      return run;
    } catch (const std::exception&) {
      continue;
    }
  }
  return std::nullopt;
}

std::optional<int> number_of(const std::string& stem) {
  int number = 0;
  const char* end = stem.data() + stem.size();
  const auto parsed = std::from_chars(stem.data(), end, number);
  if (stem.empty() || stem[0] == '-' || parsed.ec != std::errc() || parsed.ptr != end) {
    return std::nullopt;
  }
  return number;
}

/// What a file says of its place in a clip, when nothing else does.
struct ClipPlace {
  int clip = 0;
  int frame = 0;
  double time_s = 0.0;

  /// Nothing when it cannot be.
  static std::optional<ClipPlace> of(const Json& entry) {
    try {
      const ClipPlace place{whole_number<int>(entry.at("clip")),
                            whole_number<int>(entry.at("frame_index")),
                            entry.at("time_s").get<double>()};
      const bool is_first = place.frame == 0;
      const bool can_be = place.clip >= 0 && place.frame >= 0 && std::isfinite(place.time_s) &&
                          (is_first ? place.time_s == 0.0 : place.time_s > 0.0);
      return can_be ? std::optional(place) : std::nullopt;
    } catch (const std::exception&) {
      return std::nullopt;
    }
  }

  /// With the place of a file that is `captures` before: time grows evenly in a clip, and a new one
  /// begins after the last.
  bool goes_on(const ClipPlace& before, int captures) const {
    if (clip != before.clip) return clip > before.clip && frame < captures;
    const int steps = frame - before.frame;
    const double off = time_s * before.frame - before.time_s * frame;
    return steps >= 0 && steps <= captures && std::abs(off) <= 1e-8 * (frame + before.frame) &&
           (steps > 0 || time_s == before.time_s);
  }
};

struct PoseFrame {
  std::string stem;
  std::uint32_t folder = 0;
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
};

class PoseDataset final : public StoredDataset {
 public:
  PoseDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    StoredFiles files(folder_, host_, log_);
    const bool is_named = metadata_writer(folder_) == kFormat;
    files.check(is_named || !files.has("metadata.txt"), kReadable, "metadata.txt", "",
                "does not say that PoseWriter wrote this");
    folders_ = {""};
    for (const std::string& below : names_in(folder_, true)) folders_.push_back(below + "/");
    for (std::uint32_t i = 0; i < folders_.size(); ++i) list(i, files);
    if (frames_.empty() && !is_named) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no files of PoseWriter");
    }
    group(files);
    describe();
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  void list(std::uint32_t place, StoredFiles& files) {
    const std::string& folder = folders_[place];
    std::set<std::string> tables;
    std::vector<ListedPicture> pictures;
    for (const std::string& name : names_in(folder_ / folder)) {
      const fs::path path(name);
      const std::string stem = path.stem().string();
      const std::string ending = path.extension().string();
      if (ending == ".json" && number_of(stem)) tables.insert(stem);
      if (is_picture_ending(ending)) pictures.push_back({stem, ending, place, 0, 0});
    }
    if (tables.empty() && !folder.starts_with(kProduct)) return;
    std::set<std::string> overlays;
    constexpr std::string_view kOverlay = "_overlay";
    for (const ListedPicture& picture : pictures) {
      std::string stem = picture.stem;
      const bool is_overlay = stem.ends_with(kOverlay);
      if (is_overlay) stem.resize(stem.size() - kOverlay.size());
      if (!number_of(stem)) continue;
      if (is_overlay) {
        overlays.insert(stem);
        overlay_ending_ = picture.ending;
      }
      files.check(tables.contains(stem), kMissing, folder + stem + ".json", "",
                  "the file is not there", "one for " + folder + picture.stem + picture.ending);
    }
    for (const std::string& stem : tables) {
      frames_.push_back({stem, place, *number_of(stem), 0});
      if (!overlays.contains(stem)) lacking_.push_back(folder + stem);
    }
  }

  void group(StoredFiles& files) {
    const bool is_flat =
        std::ranges::any_of(frames_, [](const PoseFrame& frame) { return frame.folder == 0; });
    const auto run = page_of_run(folder_);
    cameras_ = said_cameras(folder_);
    if (cameras_.empty() && run) cameras_ = run->cameras;
    if (is_flat) {
      if (cameras_.empty()) cameras_ = {"camera"};
      const auto count = std::int32_t(cameras_.size());
      for (PoseFrame& frame : frames_) {
        if (frame.folder != 0) continue;
        frame.camera = std::uint32_t(frame.capture % count);
        frame.capture /= count;
      }
    }
    for (PoseFrame& frame : frames_) {
      if (frame.folder == 0) continue;
      std::string name = folders_[frame.folder];
      name.pop_back();
      if (name.starts_with(kProduct)) name.erase(0, kProduct.size());
      auto found = std::ranges::find(cameras_, name);
      if (found == cameras_.end()) found = cameras_.insert(cameras_.end(), name);
      frame.camera = std::uint32_t(found - cameras_.begin());
    }
    frames_ = sorted_once(std::move(frames_), [&](const PoseFrame& frame, const PoseFrame* known) {
      files.check(!known, kOnce, folders_[frame.folder] + frame.stem + ".json", "",
                  "its number is there a second time");
    });
    number_captures(run ? run->captures : 0);
    has_page_ = run.has_value();
    if (run) clips_ = run->clips;
    if (overlay_ending_.empty()) return;
    for (const std::string& stem : lacking_) {
      files.find(kMissing, stem + "_overlay" + overlay_ending_, "", "the drawing is not there",
                 "other pictures have one");
    }
  }

  /// Captures of a run that the writer left out, because nothing is in sight, have no frames.
  void number_captures(int planned) {
    const bool is_plan = frames_.empty() || frames_.back().capture < planned;
    for (int capture = 0; is_plan && capture < planned; ++capture) {
      info_.captures.push_back(capture);
    }
    for (const PoseFrame& frame : frames_) {
      const bool is_new = info_.captures.empty() || info_.captures.back() < frame.capture;
      if (is_new) info_.captures.push_back(frame.capture);
    }
    for (const int capture : info_.captures) {
      const auto first = std::ranges::lower_bound(frames_, capture, {}, &PoseFrame::capture);
      first_.push_back(std::size_t(first - frames_.begin()));
    }
    first_.push_back(frames_.size());
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = cameras_;
    info_.holds = {std::string(kHoldsInstances), std::string(kHoldsLabels),
                   std::string(kHoldsNodePaths), std::string(kHoldsOcclusion),
                   std::string(kHoldsCamera),    std::string(kHoldsCameraPose)};
    if (!overlay_ending_.empty()) info_.holds.emplace(kOverlays);
    note_clips(clips_, info_);
    info_.steps[std::string(kHoldsOcclusion)] = 5.1e-4;
    // The view matrix has five decimals.
    info_.steps[std::string(kHoldsCameraPose)] = 2e-4;
    for (const PoseFrame& frame : frames_) {
      const std::string file = picture_file(frame);
      if (file.empty()) continue;
      info_.holds.emplace(file.ends_with(".exr") ? kColorHdr.name : kColor.name);
      if (!file.ends_with(".png")) info_.steps[std::string(kColor.name)] = 16.0;
      break;
    }
    std::size_t seen = 0;
    std::size_t right = 0;
    std::size_t swapped = 0;
    std::size_t pinhole = 0;
    for (std::size_t i = 0; i < frames_.size() && seen < kLookedAt; ++i) {
      const auto file = look_at(frames_[i]);
      if (!file) continue;
      if (!file->objects.empty() && !has_layout_) {
        layout_ = file->layout;
        has_layout_ = true;
      }
      if (!file->objects.empty()) ++seen;
      for (const StoredPose& object : file->objects) {
        if (const auto miss = pose_miss(*file, object)) {
          const double slack = slack_of(*file, object);
          if (miss->right <= slack && miss->swapped > slack) ++right;
          if (miss->right > slack && miss->swapped <= slack) ++swapped;
        }
        if (has_good_pixels(*file, object)) ++pinhole;
      }
    }
    is_swapped_ = swapped > right;
    is_right_ = right > swapped;
    checks_pixels_ = !is_swapped_ || pinhole > 0;
    if (is_swapped_) info_.steps[std::string(kHoldsCamera)] = 0.02;
    if (!has_layout_ || layout_ == PoseLayout::Dope) return;
    info_.holds.emplace(kHoldsBoxes3d);
    info_.steps[std::string(kHoldsBoxes3d)] = 1e-4;
    if (layout_ == PoseLayout::Full) {
      info_.holds.insert({std::string(kHoldsPoses), std::string(kHoldsBounds)});
    }
  }

  std::optional<StoredPoseFile> look_at(const PoseFrame& frame) const {
    ReadLog ignored;
    StoredFiles files(folder_, host_, ignored);
    std::optional<StoredPoseFile> file;
    const std::string table = folders_[frame.folder] + frame.stem + ".json";
    const auto text = files.text(table);
    if (!text) return std::nullopt;
    files.reading(table, [&] {
      file = parse_pose_file(*text);
      if (file->camera.width > 0) return;
      const std::string picture = picture_file(frame);
      const auto decoded = picture.empty() ? std::nullopt : files.picture(picture);
      if (decoded) file = parse_pose_file(*text, decoded->width(), decoded->height());
    });
    return file;
  }

  /// The place in a clip of the same camera's file before this one, and how many captures before.
  std::optional<std::pair<ClipPlace, int>> place_before(const PoseFrame& frame) const {
    const auto first = std::ranges::lower_bound(frames_, frame.capture, {}, &PoseFrame::capture);
    const auto before =
        std::find_if(std::make_reverse_iterator(first), frames_.rend(),
                     [&](const PoseFrame& other) { return other.camera == frame.camera; });
    if (before == frames_.rend()) return std::nullopt;
    ReadLog ignored;
    StoredFiles files(folder_, host_, ignored);
    const std::string table = folders_[before->folder] + before->stem + ".json";
    std::optional<ClipPlace> place;
    if (const auto text = files.text(table)) {
      files.reading(table, [&] { place = ClipPlace::of(clip_entry(parse_stored_json(*text))); });
    }
    if (!place) return std::nullopt;
    return std::pair(*place, frame.capture - before->capture);
  }

  static double slack_of(const StoredPoseFile& file, const StoredPose& object) {
    if (object.size) return 1e-3 + 0.01 * object.size->norm();
    return 1.5 / std::min(file.camera.fx, file.camera.fy);
  }

  /// By the reference's own formula, which knows no lens.
  static bool has_good_pixels(const StoredPoseFile& file, const StoredPose& object) {
    if (object.camera_points.empty()) return true;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < object.camera_points.size(); ++i) {
      const auto pixel = project(file.projection, object.camera_points[i]);
      if (pixel && (*pixel - object.pixels[i]).cwiseAbs().maxCoeff() > 0.6) ++wrong;
    }
    return wrong == 0;
  }

  /// Empty when there is none.
  std::string picture_file(const PoseFrame& frame) const {
    std::error_code ignored;
    for (const char* ending : {".png", ".jpg", ".jpeg", ".exr"}) {
      const std::string file = folders_[frame.folder] + frame.stem + ending;
      if (fs::is_regular_file(folder_ / file, ignored)) return file;
    }
    return {};
  }

  friend class PoseFrameReading;

  fs::path folder_;
  const Host& host_;
  std::vector<std::string> folders_;  ///< "" and those below, with '/'.
  std::vector<PoseFrame> frames_;
  std::vector<std::size_t> first_;  ///< Per capture, and one behind the last.
  std::vector<std::string> cameras_;
  bool has_page_ = false;             ///< Of a run.
  std::vector<DatasetClip> clips_;    ///< By that page.
  std::vector<std::string> lacking_;  ///< Stems without a drawing.
  std::string overlay_ending_;        ///< Empty: there are no drawings.
  bool has_layout_ = false;
  PoseLayout layout_ = PoseLayout::Full;
  bool is_swapped_ = false;  ///< Camera-frame poses are the reference's.
  bool is_right_ = false;    ///< They are known to be none of those.
  bool checks_pixels_ = true;
  StoredInfo info_;
  ReadLog log_;
};

/// Where cameras of one capture see an object's origin, in the world.
struct SeenLocation {
  Vec3 place;
  std::string label;
};
using SeenLocations = std::map<std::string, SeenLocation>;

/// Makes one frame of one file and its picture.
class PoseFrameReading : private FrameReading {
 public:
  PoseFrameReading(const PoseDataset& dataset, const PoseFrame& of, const NameSet& wanted,
                   ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, of.capture,
                     dataset.cameras_[of.camera], wanted, log),
        dataset_(dataset),
        of_(of),
        table_(dataset.folders_[of.folder] + of.stem + ".json") {}

  std::optional<Frame> read(FrameSources& sources) {
    const auto text = files_.text(table_);
    std::optional<StoredPoseFile> file;
    if (text) files_.reading(table_, [&] { file = parse_pose_file(*text); });
    read_picture(file && file->camera.width > 0 ? &file->camera : nullptr, sources);
    if (file && file->camera.width == 0 && has_size_) {
      files_.reading(table_, [&] {
        file = parse_pose_file(*text, frame_.camera.width, frame_.camera.height);
      });
    }
    if (!has_size_) return std::nullopt;
    check_overlay();
    if (!file) return std::move(frame_);
    file_ = std::move(*file);
    read_camera();
    check_clip();
    for (const StoredPose& object : file_.objects) add_object(object);
    for (const std::string_view held : {kHoldsInstances, kHoldsCamera, kHoldsCameraPose}) {
      sources.emplace(held, table_);
    }
    return std::move(frame_);
  }

  /// What the file says of its place in a clip, which is the same for all cameras of the capture.
  const Json& clip() const { return file_.clip; }
  void compare_clip(const Json& other) {
    files_.check(file_.clip == other, kCounts, table_, "",
                 "its place in a clip is " + file_.clip.dump(),
                 other.dump() + ", as by other cameras");
  }

  /// With the other cameras of the capture.
  void compare(SeenLocations& known) {
    const auto near = [&](const Vec3& a, const Vec3& b) {
      return (a - b).norm() <= 1e-3 * (1.0 + std::max(a.norm(), b.norm()));
    };
    SeenLocations own;
    for (const StoredPose& object : file_.objects) {
      own.try_emplace(object.path,
                      SeenLocation{world_from_camera_ * object.location, object.label});
    }
    for (const auto& each : own) {
      const std::string& path = each.first;
      const SeenLocation& seen = each.second;
      const auto same = known.find(path);
      if (same != known.end()) {
        files_.check(near(same->second.place, seen.place), kPose, table_, path,
                     "its location is another one than by other cameras");
        continue;
      }
      const auto twin = std::ranges::find_if(known, [&](const auto& other) {
        return !own.contains(other.first) && other.second.label == seen.label &&
               near(other.second.place, seen.place);
      });
      files_.check(twin == known.end(), kPose, table_, path,
                   "is where other cameras see " + (twin == known.end() ? "" : twin->first));
    }
    known.merge(own);
  }

 private:
  void read_picture(const Camera* said, FrameSources& sources) {
    if (said) {
      frame_.camera.width = said->width;
      frame_.camera.height = said->height;
      has_size_ = true;
    }
    const std::string file = dataset_.picture_file(of_);
    files_.check(!file.empty(), kMissing, dataset_.folders_[of_.folder] + of_.stem + ".png", "",
                 "the picture is not there", "one for " + table_);
    if (file.empty()) return;
    if (has_size_ && !wants(kColor.name) && !wants(kColorHdr.name)) return;
    const auto picture =
        has_size_ ? files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, table_)
                  : files_.picture(file);
    if (!picture) return;
    set_size(*picture);
    has_size_ = true;
    if (file.ends_with(".exr")) {
      if (wants(kColorHdr.name)) set_light(*picture, file, sources);
    } else if (wants(kColor.name)) {
      frame_.set(kColor, picture->color());
      sources.emplace(kColor.name, file);
    }
  }

  /// One that is not there was found when the folder was opened.
  void check_overlay() {
    if (!wants(kOverlays)) return;
    const std::string file =
        dataset_.folders_[of_.folder] + of_.stem + "_overlay" + dataset_.overlay_ending_;
    if (!files_.has(file)) return;
    files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, table_);
  }

  void set_light(const StoredPicture& picture, const std::string& file, FrameSources& sources) {
    files_.reading(file, [&] {
      const auto& floats = picture.texture->floats;
      if (floats.empty() || picture.channels() < 3)
        throw std::runtime_error("has no three channels");
      Image<Vec3f> light(picture.width(), picture.height(), Vec3f::Zero());
      const auto channels = std::size_t(picture.channels());
      for (std::size_t i = 0; i < light.pixels().size(); ++i) {
        const float* pixel = floats.data() + i * channels;
        light.pixels()[i] = {pixel[0], pixel[1], pixel[2]};
      }
      frame_.set(kColorHdr, std::move(light));
      sources.emplace(kColorHdr.name, file);
    });
  }

  void check_clip() {
    if (dataset_.has_page_) {
      check_clip_frame(file_.clip, dataset_.clips_, of_.capture, files_, table_, "");
      return;
    }
    if (file_.clip.empty()) return;
    const auto place = ClipPlace::of(file_.clip);
    files_.check(place.has_value(), kCounts, table_, "",
                 "its place in a clip is " + file_.clip.dump(),
                 "clip, frame_index and time_s, which grows from 0 with the frame");
    const auto before = place ? dataset_.place_before(of_) : std::nullopt;
    files_.check(!before || place->goes_on(before->first, before->second), kCounts, table_, "",
                 "its place in a clip, " + file_.clip.dump() + ", does not follow the one before",
                 "the next frame, or a new clip");
  }

  void read_camera() {
    const Camera& from = dataset_.is_swapped_ ? file_.projection : file_.camera;
    const int width = frame_.camera.width;
    const int height = frame_.camera.height;
    frame_.camera = from;
    frame_.camera.width = width;
    frame_.camera.height = height;
    Affine camera_from_world = Affine::Identity();
    camera_from_world.matrix() = file_.view.transpose();
    const Mat3 turn = camera_from_world.linear();
    files_.check(
        (turn * turn.transpose() - Mat3::Identity()).norm() < 1e-3 && turn.determinant() > 0.0,
        kPose, table_, "", "its view matrix is no rotation and shift");
    files_.check(file_.view.col(3) == Eigen::Vector4d(0.0, 0.0, 0.0, 1.0), kPose, table_, "",
                 "the last column of its view matrix is not 0, 0, 0, 1");
    check_projection();
    const Mat3 rotation = Transform::from_affine(camera_from_world).rotation.toRotationMatrix();
    frame_.world_from_camera.linear() = rotation.transpose();
    frame_.world_from_camera.translation() =
        -(rotation.transpose() * camera_from_world.translation());
    world_from_camera_ = frame_.world_from_camera;
  }

  /// What the camera says of itself in several ways. The reference has errors of its own in
  /// intrinsics, so that these are compared where poses follow no such rules.
  void check_projection() {
    const auto check = [&](bool holds, const char* found, const char* expected = "") {
      files_.check(holds, kProject, table_, "", found, expected);
    };
    if (file_.optics) {
      check(file_.optics->metres_per_unit > 0.0, "meters_per_scene_unit is not above 0");
    }
    if (!file_.clip_from_camera) return;
    const Mat4& clip = *file_.clip_from_camera;
    Mat4 other = clip;
    for (const auto& [row, column] : {std::pair(0, 0), {0, 2}, {1, 1}, {1, 2}, {2, 2}, {2, 3}}) {
      other(row, column) = 0.0;
    }
    other(3, 2) += 1.0;
    check(other.isZero() && clip(2, 2) >= 0.0 && clip(2, 2) < 1.0 && clip(2, 3) > 0.0,
          "its projection matrix is none of a camera");
    if (!dataset_.is_right_) return;
    const Vec2 size(frame_.camera.width, frame_.camera.height);
    const Camera& camera = file_.camera;
    const Camera& by_clip = file_.projection;
    const Eigen::Vector4d said(camera.fx, camera.fy, camera.cx, camera.cy);
    const Eigen::Vector4d projected(by_clip.fx, by_clip.fy, by_clip.cx, by_clip.cy);
    check((said - projected).cwiseAbs().maxCoeff() <= 1e-5 * size.maxCoeff(),
          "its intrinsics are not those of its projection matrix");
    if (!file_.optics) return;
    const StoredOptics& optics = *file_.optics;
    const double per_pixel = optics.aperture.x() / size.x();
    const double slack = 1e-5 * size.maxCoeff() * std::abs(per_pixel);
    check(optics.aperture.x() > 0.0 &&
              std::abs(optics.aperture.y() - per_pixel * size.y()) <= slack &&
              std::abs(optics.focal_length - per_pixel * camera.fx) <= slack,
          "its aperture and focal length are not those of its intrinsics");
    const Vec2 offset = per_pixel * Vec2(0.5 * size.x() - camera.cx, camera.cy - 0.5 * size.y());
    check((optics.offset - offset).cwiseAbs().maxCoeff() <= slack,
          "its aperture_offset is not that of its intrinsics");
  }

  void add_object(const StoredPose& object) {
    const std::string& who = object.path;
    const bool is_first = std::ranges::find(frame_.instances, object.path, &Instance::node_path) ==
                          frame_.instances.end();
    files_.check(is_first, kOnce, table_, who, "is there a second time");
    files_.check(!object.label.empty(), kIds, table_, who, "has no label");
    files_.check(object.visibility >= 0.0 && object.visibility <= 1.0, kAmodal, table_, who,
                 "its visibility is " + std::to_string(object.visibility), "0 to 1");
    check_truncation(object);
    check_pixels(object);
    check_named(object);
    check_world(object);
    check_camera_pose(object);
    Instance instance;
    instance.id = std::uint32_t(frame_.instances.size()) + 1;
    instance.node_path = object.path;
    instance.labels["class"] = object.label;
    constexpr std::int64_t kUnknownSize = std::int64_t(1) << 24;
    Visibility seen;
    seen.amodal_pixels = kUnknownSize;
    seen.visible_pixels =
        std::llround(std::clamp(object.visibility, 0.0, 1.0) * double(kUnknownSize));
    instance.visibility = std::move(seen);
    set_box(object, instance);
    frame_.instances.push_back(std::move(instance));
  }

  void set_box(const StoredPose& object, Instance& instance) {
    if (object.world_from_local) {
      instance.world_from_node.matrix() = object.world_from_local->transpose();
      const Affine node_from_world = instance.world_from_node.inverse();
      for (const Vec3& point : object.world_points) {
        instance.bounds_node.add(node_from_world * point);
      }
      return;
    }
    if (object.camera_points.empty() || !object.size) {
      Affine camera_from_node = Affine::Identity();
      camera_from_node.linear() = object.rotation.toRotationMatrix();
      camera_from_node.translation() = object.location;
      instance.world_from_node = frame_.world_from_camera * camera_from_node;
      return;
    }
    Affine camera_from_box = Affine::Identity();
    camera_from_box.linear() = object.rotation.toRotationMatrix();
    if (dataset_.is_swapped_) camera_from_box.linear() = turn_of_keypoints(object);
    for (std::size_t i = 0; i < file_.sides.size(); ++i) {
      if (file_.sides[i].isZero()) camera_from_box.translation() = object.camera_points[i];
    }
    instance.world_from_node = frame_.world_from_camera * camera_from_box;
    instance.bounds_node.add(-0.5 * *object.size);
    instance.bounds_node.add(0.5 * *object.size);
  }

  /// By the edges of the box; what is too thin for that is taken from the file.
  Mat3 turn_of_keypoints(const StoredPose& object) const {
    Mat3 turn = unswapped(file_, object.rotation.toRotationMatrix());
    for (int axis = 0; axis < 3; ++axis) {
      Vec3 along = Vec3::Zero();
      for (std::size_t i = 0; i < file_.sides.size(); ++i) {
        along += file_.sides[i][axis] * object.camera_points[i];
      }
      if (along.norm() > 1e-6) turn.col(axis) = along.normalized();
    }
    return turn;
  }

  /// Share of the box round the pixels that lies outside the picture.
  void check_truncation(const StoredPose& object) {
    if (!object.truncation) return;
    Vec2 low = object.pixels[0];
    Vec2 high = object.pixels[0];
    for (const Vec2& pixel : object.pixels) {
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
    const double area = (high - low).prod();
    const Vec2 size(frame_.camera.width, frame_.camera.height);
    const Vec2 inside = high.cwiseMin(size).cwiseMax(0.0) - low.cwiseMin(size).cwiseMax(0.0);
    const double expected = area == 0.0 ? 1.0 : 1.0 - inside.prod() / area;
    files_.check(std::abs(*object.truncation - expected) <= 1e-5, kProject, table_, object.path,
                 "its truncation_ratio is " + std::to_string(*object.truncation),
                 std::to_string(expected) + ", by its projected keypoints");
  }

  void check_pixels(const StoredPose& object) {
    if (!dataset_.checks_pixels_) return;
    const Camera& camera = frame_.camera;
    for (std::size_t i = 0; i < object.camera_points.size(); ++i) {
      const auto expected = project(camera, object.camera_points[i]);
      if (!expected) continue;
      const Vec2& found = object.pixels[i];
      const double slack = dataset_.is_swapped_ ? 0.6 : 0.51;
      files_.check((*expected - found).cwiseAbs().maxCoeff() <= slack, kProject, table_,
                   object.path,
                   "its keypoint " + std::to_string(i) + " is at " + std::to_string(found.x()) +
                       ", " + std::to_string(found.y()),
                   std::to_string(expected->x()) + ", " + std::to_string(expected->y()) +
                       ", where its camera-frame point projects to");
    }
  }

  /// Seen or hidden, a named point is where its place projects to; no other one is in the image.
  void check_named(const StoredPose& object) {
    const Camera& camera = frame_.camera;
    for (const ObjectPose::Named& point : object.named) {
      const auto expected = project(camera, point.camera_point);
      const Vec2 size(camera.width, camera.height);
      const bool is_inside =
          expected && (expected->array() >= 0.0).all() && (expected->array() < size.array()).all();
      const bool is_said = point.image.state != ImagePoint::State::Outside;
      constexpr double kEdge = 1e-3;  // numbers are rounded
      const bool is_at_edge = expected && (expected->cwiseAbs().minCoeff() < kEdge ||
                                           (*expected - size).cwiseAbs().minCoeff() < kEdge);
      files_.check(is_inside == is_said || is_at_edge, kProject, table_, object.path,
                   "its point '" + point.name + "' is said to be " +
                       (is_said ? "in the image" : "outside of the image"),
                   is_inside ? "in the image" : "outside of the image");
      if (!is_inside || !is_said) continue;
      files_.check((*expected - point.image.pixel).cwiseAbs().maxCoeff() <= 0.01, kProject, table_,
                   object.path,
                   "its point '" + point.name + "' is at " + std::to_string(point.image.pixel.x()) +
                       ", " + std::to_string(point.image.pixel.y()),
                   std::to_string(expected->x()) + ", " + std::to_string(expected->y()) +
                       ", where its camera-frame place projects to");
    }
  }

  static Vec3 mapped(const Mat4& row_vector_matrix, const Vec3& point) {
    return (point.homogeneous().transpose() * row_vector_matrix).head<3>().transpose();
  }

  /// World-frame entries against each other and against the camera frame.
  void check_world(const StoredPose& object) {
    if (!object.world_from_local) return;
    const Mat4& world = *object.world_from_local;
    const auto near = [](const Vec3& a, const Vec3& b, double slack) {
      return (a - b).norm() <= slack * (1.0 + b.norm());
    };
    const auto check = [&](bool holds, const std::string& found, const std::string& expected = {}) {
      files_.check(holds, kPose, table_, object.path, found, expected);
    };
    // The file's view matrix is rounded to five decimals.
    for (std::size_t i = 0; i < object.world_points.size(); ++i) {
      check(near(mapped(file_.view, object.world_points[i]), object.camera_points[i], 1e-3),
            "its keypoint " + std::to_string(i) + " differs between world and camera frame");
    }
    check(near(world.row(3).head<3>().transpose(), object.world_location, 1e-5),
          "its location_world_frame is not that of local_to_world_transform");
    check((object.world_matrix - world.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff() <= 1e-5,
          "its rotation_matrix_world_frame is not that of local_to_world_transform");
    check(world.col(3) == Eigen::Vector4d(0.0, 0.0, 0.0, 1.0),
          "the last column of local_to_world_transform is not 0 0 0 1");
    check(is_turned_like(object.world_rotation, rotation_of(world)),
          "its quat_wxyz_world_frame is not the turn of local_to_world_transform",
          "(quaternion order?)");
    // Corners lie where the box that the centre and one corner span has them.
    const Mat4 local_from_world = world.inverse();
    Aabb box;
    for (const Vec3& point : object.world_points) box.add(mapped(local_from_world, point));
    const Vec3 scale = world.topLeftCorner<3, 3>().rowwise().norm();
    double worst = 0.0;
    for (std::size_t i = 0; i < object.world_points.size(); ++i) {
      const Vec3 corner = box.centre() + 0.5 * file_.sides[i].cwiseProduct(box.size());
      worst = std::max(worst, (mapped(world, corner) - object.world_points[i]).norm());
    }
    const double slack = 1e-4 * (1.0 + object.size->norm());
    check(std::isfinite(worst) && worst <= slack, "local_to_world_transform puts a corner " +
                                                      std::to_string(worst) +
                                                      " m beside its keypoint");
    check((box.size().cwiseProduct(scale) - *object.size).norm() <= slack,
          "its size is not that of its keypoints");
  }

  static bool is_turned_like(const Quat& a, const Quat& b) {
    const double off = std::min((a.coeffs() - b.coeffs()).norm(), (a.coeffs() + b.coeffs()).norm());
    return std::abs(a.norm() - 1.0) < 1e-4 && off < 1e-3;
  }

  void check_camera_pose(const StoredPose& object) {
    const double length = object.rotation.norm();
    files_.check(std::abs(length - 1.0) < 1e-4, kPose, table_, object.path,
                 "its quaternion has length " + std::to_string(length), "1");
    if (const auto miss = pose_miss(file_, object)) {
      const double found = dataset_.is_swapped_ ? miss->swapped : miss->right;
      // The reference's product turns scales along; only equal ones can be told.
      const bool can_tell = !dataset_.is_swapped_ || has_equal_scales(object);
      files_.check(!can_tell || found <= PoseDataset::slack_of(file_, object), kPose, table_,
                   object.path,
                   "its camera-frame rotation misses its keypoints by " + std::to_string(found) +
                       (object.size ? " m" : " rad"),
                   "none (swapped product or quaternion order?)");
    }
    if (object.world_from_local) {
      const Mat4 pose = dataset_.is_swapped_ ? Mat4(file_.view * *object.world_from_local)
                                             : Mat4(*object.world_from_local * file_.view);
      const Vec3 place = pose.row(3).head<3>().transpose();
      files_.check((place - object.location).norm() <= 1e-3 * (1.0 + place.norm()), kPose, table_,
                   object.path,
                   "its camera-frame location is " +
                       std::to_string((place - object.location).norm()) +
                       " m from the world-frame one");
      files_.check((pose.topLeftCorner<3, 3>() - object.camera_matrix).cwiseAbs().maxCoeff() <=
                       1e-3 * (1.0 + pose.topLeftCorner<3, 3>().cwiseAbs().maxCoeff()),
                   kPose, table_, object.path,
                   "its rotation_matrix_camera_frame is not that of its world-frame pose");
      files_.check(is_turned_like(object.rotation, rotation_of(pose)), kPose, table_, object.path,
                   "its quat_wxyz_camera_frame is not the turn of its world-frame pose",
                   "(quaternion order?)");
      return;
    }
    if (!dataset_.is_swapped_ && !object.camera_points.empty()) check_origin(object);
  }

  bool has_equal_scales(const StoredPose& object) const {
    if (!object.world_from_local) return false;
    const Vec3 scale = object.world_from_local->topLeftCorner<3, 3>().rowwise().norm();
    return scale.maxCoeff() - scale.minCoeff() <= 1e-3 * scale.maxCoeff();
  }

  /// A location lies where the object is: where in its box is nothing that one file can tell.
  void check_origin(const StoredPose& object) {
    Vec3 centre = Vec3::Zero();
    for (std::size_t i = 0; i < file_.sides.size(); ++i) {
      if (file_.sides[i].isZero()) centre = object.camera_points[i];
    }
    const Vec3 aside = object.rotation.inverse() * (object.location - centre);
    const Vec3 slack = Vec3::Constant(1e-3) + 0.51 * *object.size;
    // Most models have their origin in their box, or below it.
    const bool is_near = (aside.cwiseAbs().array() <= (2.0 * slack).array()).all();
    files_.check(is_near, kPose, table_, object.path,
                 "its camera-frame location is " + std::to_string(aside.norm()) +
                     " m from the middle of its keypoints");
  }

  const PoseDataset& dataset_;
  const PoseFrame& of_;
  std::string table_;
  StoredPoseFile file_;
  Affine world_from_camera_ = Affine::Identity();  ///< The frame goes to the caller.
  bool has_size_ = false;
};

StoredCapture PoseDataset::read(std::size_t i, const NameSet& wanted) const {
  const auto frames = std::span(frames_).subspan(first_.at(i), first_.at(i + 1) - first_[i]);
  SeenLocations locations;
  std::optional<Json> clip;
  return read_frames(info_.captures.at(i), clips_, frames,
                     [&](const PoseFrame& frame, StoredCapture& stored, FrameSources& sources) {
                       PoseFrameReading reading(*this, frame, wanted, stored.log);
                       auto result = reading.read(sources);
                       if (is_right_) reading.compare(locations);
                       if (result && clip && !has_page_) reading.compare_clip(*clip);
                       if (result && !clip) clip = reading.clip();
                       return result;
                     });
}

}  // namespace

std::vector<std::string> PoseReader::patterns() const {
  return {"metadata.txt", "*.json", "rp_*/*.json"};
}

Recognition PoseReader::recognise(const fs::path& folder) const {
  const std::string said = metadata_writer(folder);
  if (said == kFormat) return Recognition::ByName;
  if (!said.empty()) return Recognition::No;
  std::vector<std::string> folders{""};
  for (const std::string& below : names_in(folder, true)) {
    if (below.starts_with(kProduct)) folders.push_back(below + "/");
  }
  for (const std::string& below : folders) {
    for (const std::string& name : names_in(folder / below)) {
      const fs::path path(name);
      if (path.extension() != ".json" || !number_of(path.stem().string())) continue;
      try {
        const Json json = parse_stored_json(read_whole_file(folder / below / name, 1 << 24));
        return is_pose_file(json) ? Recognition::ByFiles : Recognition::No;
      } catch (const std::exception&) {
        break;
      }
    }
  }
  return Recognition::No;
}

std::unique_ptr<const StoredDataset> PoseReader::open(const fs::path& folder) const {
  return std::make_unique<PoseDataset>(folder, host_);
}

}  // namespace diorama
