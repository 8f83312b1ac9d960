// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "diorama/error.h"
#include "reader_support/camera_json.h"
#include "reader_support/capture_rows.h"
#include "reader_support/dataset_page.h"
#include "reader_support/frame_reading.h"
#include "reader_support/object_masks.h"
#include "reader_support/picture_list.h"
#include "writer_bop/bop_format.h"
#include "writer_bop/bop_model_info.h"
#include "writer_bop/bop_scenes.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "BOP";
constexpr const char* kArea = "area = count";
constexpr const char* kPose = "pose agrees with the keypoints";
constexpr double kMetres = 0.001;

/// Our camera axes from BOP's: y and z change sign.
Affine camera_from_bop() {
  Affine map = Affine::Identity();
  map.linear() = Vec3(1.0, -1.0, -1.0).asDiagonal();
  return map;
}

Mat3 matrix_of(const Json& list) {
  Mat3 matrix;
  for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = list.at(std::size_t(i)).get<double>();
  if (!matrix.allFinite()) throw std::runtime_error("a matrix has numbers that are not finite");
  return matrix;
}

/// Widths are differences of the first and the last pixel; nothing for what no pixel shows.
std::optional<PixelBox> box_of(const Json& bbox) {
  std::array<int, 4> n{};
  for (std::size_t i = 0; i < 4; ++i) {
    const double value = bbox.at(i).get<double>();
    if (!(std::abs(value) < 1e8)) throw std::runtime_error("a bbox is beyond reason");
    n[i] = int(std::floor(value));
  }
  if (n[2] < 0 || n[3] < 0) return std::nullopt;
  return PixelBox{n[0], n[1], n[0] + n[2] + 1, n[1] + n[3] + 1};
}

bool is_rotation(const Mat3& matrix, double slack) {
  return (matrix * matrix.transpose() - Mat3::Identity()).norm() < slack &&
         matrix.determinant() > 0.0;
}

/// Objects of the scenes to test on, by scene, image and object; and the images.
struct Targets {
  std::map<std::array<int, 3>, int> objects;
  std::multiset<std::pair<int, int>> images;
};

class BopDataset final : public StoredDataset {
 public:
  BopDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    scenes_ = find_bop_scenes(folder_);
    if (scenes_.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no scenes of BOP");
    }
    StoredFiles files(folder_, host_, log_);
    models_ = read_bop_models(files, page_);
    if (page_) check_class_order(*page_, files);
    read_names(files);
    Targets targets;
    for (std::uint32_t i = 0; i < scenes_.size(); ++i) read_scene(i, files, targets);
    group(files);
    if (page_) check_own_files(files, targets);
    describe();
    note_clips(clips_of(page_), info_);
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  /// Place of a scene's camera in the list; of our own without suffixes it is the scene's number.
  std::optional<std::uint32_t> camera_of(const BopScene& scene) {
    const bool by_number = page_ && scene.suffix.empty();
    if (by_number) {
      if (std::size_t(scene.number) >= page_->cameras.size()) return std::nullopt;
      return std::uint32_t(scene.number);
    }
    const std::string name = scene.suffix.empty() ? "camera" : scene.suffix.substr(1);
    auto& names = page_ ? page_->cameras : cameras_;
    auto found = std::ranges::find(names, name);
    if (found == names.end()) {
      if (page_) return std::nullopt;
      found = names.insert(names.end(), name);
    }
    return std::uint32_t(found - names.begin());
  }

  void read_scene(std::uint32_t place, StoredFiles& files, Targets& targets) {
    const BopScene& scene = scenes_[place];
    log_.files += std::size_t(scene.has_cameras) + std::size_t(scene.has_poses) +
                  std::size_t(scene.has_infos);
    const auto camera = camera_of(scene);
    files.check(camera.has_value(), kCounts, scene.folder + "scene_gt" + scene.suffix + ".json", "",
                "is of no camera that dataset.json has");
    if (!camera) return;
    if (page_) {
      for (const auto& [has, name] :
           {std::pair(scene.has_cameras, "scene_camera"), std::pair(scene.has_poses, "scene_gt"),
            std::pair(scene.has_infos, "scene_gt_info")}) {
        files.check(has, kMissing, scene.table(name), "", "the file is not there");
      }
    }
    const bool has_targets =
        page_ && scene.split == "test" && (scene.suffix.empty() || *camera == 0);
    std::map<int, std::vector<int>> objects;
    std::map<int, std::vector<double>> visible;
    auto images =
        read_bop_tables(scene, files, [&](bool is_info, int image, std::string_view text) {
          if (!has_targets) return;
          const Json entry = parse_stored_json(text);
          if (is_info) {
            visible[image].push_back(entry.at("visib_fract").get<double>());
          } else {
            objects[image].push_back(whole_number<int>(entry.at("obj_id")));
          }
        });
    for (const auto& [image, ids] : objects) {
      const auto& shares = visible[image];
      for (std::size_t i = 0; i < std::min(ids.size(), shares.size()); ++i) {
        if (shares[i] >= kLeastVisibleTarget) ++targets.objects[{scene.number, image, ids[i]}];
      }
    }
    for (BopImage& image : images) {
      if (has_targets) targets.images.emplace(scene.number, image.image);
      image.scene = place;
      image.camera = *camera;
      images_.push_back(image);
    }
    if (page_) check_strays(scene, images, files);
  }

  /// Pictures that no table knows.
  void check_strays(const BopScene& scene, const std::vector<BopImage>& images,
                    StoredFiles& files) {
    const std::string below = scene.place("rgb", "");
    std::set<std::string> stems;
    for (const BopImage& image : images) stems.insert(stem(image.image));
    for (const ListedPicture& picture : pictures_in(folder_ / below, 0)) {
      const bool is_known = stems.contains(picture.stem);
      files.check(is_known, kMissing, scene.table("scene_gt"), "image " + picture.stem,
                  "has no entry", "one for " + below + picture.stem + picture.ending);
    }
  }

  std::string stem(int image) const {
    const std::size_t most = page_ ? std::to_string(std::max(page_->captures - 1, 0)).size() : 0;
    return zero_padded(image, std::max<std::size_t>(6, most));
  }

  void read_names(StoredFiles& files) {
    if (!page_ && !files.has("objects.json")) return;
    if (const auto json = files.json("objects.json")) {
      files.reading("objects.json", [&] {
        for (const auto& [id, name] : json->items()) names_[id] = name.get<std::string>();
      });
    }
    if (!page_) return;
    files.reading("dataset.json", [&] {
      std::set<std::string> classes(page_->classes.begin(), page_->classes.end());
      for (const Json& object : page_->conventions.at("objects")) {
        const int id = whole_number<int>(object.at("obj_id"));
        const std::string name = object.at("class").get<std::string>();
        const std::string who = "object " + std::to_string(id);
        const auto own = names_.find(std::to_string(id));
        files.check(own != names_.end() && own->second == name, kIds, "objects.json", who,
                    own == names_.end() ? "is not there" : "is '" + own->second + "'",
                    "'" + name + "', as dataset.json says");
        files.check(std::ranges::count(page_->classes, name) == 1, kIds, "dataset.json", who,
                    "is of the class '" + name + "', which is none");
        classes.erase(name);
        files.check(files.has(bop_model_file(id)) || !object.contains("model"), kMissing,
                    bop_model_file(id), "", "the model is missing");
      }
      files.check(classes.empty(), kIds, "dataset.json", "",
                  std::to_string(classes.size()) + " classes have no object");
    });
  }

  void check_own_files(StoredFiles& files, const Targets& expected) {
    check_camera_file(files, "camera.json", std::nullopt);
    for (std::uint32_t i = 0; i < page_->cameras.size() && page_->cameras.size() > 1; ++i) {
      check_camera_file(files, "camera_" + page_->cameras[i] + ".json", i);
    }
    const std::string file = "test_targets_bop19.json";
    if (const auto targets = files.json(file)) {
      files.reading(file, [&] {
        std::map<std::array<int, 3>, int> found;
        for (const Json& target : *targets) {
          found[{whole_number<int>(target.at("scene_id")), whole_number<int>(target.at("im_id")),
                 whole_number<int>(target.at("obj_id"))}] +=
              whole_number<int>(target.at("inst_count"));
        }
        files.check(
            found == expected.objects, kCounts, file, "",
            "its targets are not the objects of test/*/scene_gt.json that are at least 10 % "
            "visible");
      });
    }
    const std::string pictures = "test_targets_bop24.json";
    if (const auto targets = files.json(pictures)) {
      files.reading(pictures, [&] {
        std::multiset<std::pair<int, int>> found;
        for (const Json& target : *targets) {
          found.emplace(whole_number<int>(target.at("scene_id")),
                        whole_number<int>(target.at("im_id")));
        }
        files.check(found == expected.images, kCounts, pictures, "",
                    "its targets are not the images of test/*/scene_gt.json");
      });
    }
  }

  /// The simulated camera is that of its first image; without a number: of the first camera.
  void check_camera_file(StoredFiles& files, const std::string& file,
                         std::optional<std::uint32_t> camera) {
    const auto json = files.json(file);
    if (!json) return;
    const auto& images = rows_.all();
    const std::uint32_t first =
        images.empty() ? 0 : std::ranges::min_element(images, {}, &BopImage::camera)->camera;
    const auto image = std::ranges::find(images, camera.value_or(first), &BopImage::camera);
    if (image == images.end()) return;
    const std::string table = scenes_[image->scene].table("scene_camera");
    files.reading(file, [&] {
      const Json own = entry(table, image->camera_entry, false);
      const auto number = [&](const char* name) { return json->at(name).get<double>(); };
      const Json& k = own.at("cam_K");
      const std::array expected{k.at(0).get<double>(), k.at(4).get<double>(), k.at(2).get<double>(),
                                k.at(5).get<double>(), own.at("depth_scale").get<double>()};
      const std::array found{number("fx"), number("fy"), number("cx"), number("cy"),
                             number("depth_scale")};
      files.check(found == expected, kCounts, file, "", "is another camera than that of " + table,
                  "image " + std::to_string(image->image));
      const std::string name = picture_file(*image);
      if (name.empty()) return;
      const auto picture = files.picture(name);
      files.check(!picture || (json->at("width") == picture->width() &&
                               json->at("height") == picture->height()),
                  kCounts, file, "", "has another size than " + name);
    });
  }

  /// Our own image ids are captures; else each image of a scene is one, all its cameras together.
  void group(StoredFiles& files) {
    if (page_) {
      std::erase_if(images_, [&](const BopImage& image) {
        const BopScene& scene = scenes_[image.scene];
        files.check(image.image < page_->captures, kCounts, scene.table("scene_gt"),
                    "image " + std::to_string(image.image),
                    "is of no capture that dataset.json plans");
        return image.image >= page_->captures;
      });
      for (BopImage& image : images_) image.capture = image.image;
    } else {
      std::int32_t next = 0;
      std::map<std::pair<std::string, int>, std::int32_t> captures;
      for (BopImage& image : images_) {
        const std::pair key(scenes_[image.scene].folder, image.image);
        const auto [found, is_new] = captures.try_emplace(key, next);
        if (is_new) ++next;
        image.capture = found->second;
      }
    }
    rows_.set(std::move(images_), [&](const BopImage& image, const BopImage* known) {
      files.check(!known, kOnce, scenes_[image.scene].table("scene_gt"),
                  "image " + std::to_string(image.image), "is there a second time",
                  known ? "only in " + scenes_[known->scene].folder : "");
    });
  }

  void describe() {
    info_.format = kFormat;
    info_.camera_names = page_ ? page_->cameras : cameras_;
    info_.captures = rows_.captures();
    if (page_) info_.classes = page_->classes;
    const auto any = [&](bool BopScene::*has) {
      return std::ranges::any_of(scenes_, [&](const BopScene& scene) { return scene.*has; });
    };
    const auto hold = [&](bool is_held, std::initializer_list<std::string_view> names) {
      if (is_held) info_.holds.insert(names.begin(), names.end());
    };
    hold(any(&BopScene::has_pictures), {kColor.name});
    hold(any(&BopScene::has_depth) && any(&BopScene::has_cameras), {kDistanceToImagePlane.name});
    hold(any(&BopScene::has_cameras), {kHoldsCamera});
    hold(any(&BopScene::has_poses), {kHoldsInstances, kHoldsLabels, kHoldsPoses});
    hold(any(&BopScene::has_poses) && any(&BopScene::has_visible_masks), {kInstanceId.name});
    hold(any(&BopScene::has_poses) &&
             (any(&BopScene::has_infos) || any(&BopScene::has_visible_masks)),
         {kHoldsTightBoxes});
    hold(any(&BopScene::has_infos) && any(&BopScene::has_masks),
         {"amodal_mask", kHoldsOcclusion, kHoldsTruncation, kHoldsAmodalBoxes});
    constexpr std::size_t kLookedAt = 1000;
    double scale = 0.0;
    bool has_seen = false;
    const auto& rows = rows_.all();
    for (std::size_t i = 0; i < std::min(rows.size(), kLookedAt); ++i) {
      has_seen = has_seen || look_at(rows[i]);
      if (!(scale > 0.0)) scale = depth_scale_of(rows[i]);
      if (has_seen && scale > 0.0) break;
    }
    info_.steps[std::string(kDistanceToImagePlane.name)] = 0.5 * kMetres * scale;
    if (!page_) {
      // People measured poses, and models stand for objects.
      info_.steps[std::string(kHoldsTightBoxes)] = 2.0;
      info_.steps[std::string(kHoldsPoses)] = 0.01;
      info_.steps[std::string(kHoldsBoxes3d)] = 0.01;
    }
    const bool is_lossy = !rows.empty() && !picture_file(rows[0]).ends_with(".png");
    if (is_lossy) info_.steps[std::string(kColor.name)] = 16.0;
  }

  /// What the first image with objects says.
  bool look_at(const BopImage& image) {
    try {
      const BopScene& scene = scenes_[image.scene];
      if (image.camera_entry.length > 0) {
        const Json camera = entry(scene.table("scene_camera"), image.camera_entry, false);
        if (camera.contains("cam_R_w2c")) info_.holds.emplace(kHoldsCameraPose);
      }
      if (image.poses.length == 0) return false;
      const Json poses = entry(scene.table("scene_gt"), image.poses, true);
      if (poses.at(0).contains("node")) info_.holds.emplace(kHoldsNodePaths);
      if (poses.at(0).contains("bounds_min") || !models_.empty()) {
        info_.holds.insert({std::string(kHoldsBounds), std::string(kHoldsBoxes3d)});
      }
      return true;
    } catch (const std::exception&) {
      return false;
    }
  }

  double depth_scale_of(const BopImage& image) const {
    try {
      const std::string table = scenes_[image.scene].table("scene_camera");
      const Json camera = entry(table, image.camera_entry, false);
      return camera.contains("depth_scale") ? camera.at("depth_scale").get<double>() : 1.0;
    } catch (const std::exception&) {
      return 0.0;
    }
  }

  Json entry(const std::string& table, JsonSpan span, bool is_list) const {
    if (span.length == 0) return is_list ? Json::array() : Json::object();
    const std::string text = read_span(folder_ / table, span);
    return parse_stored_json(is_list ? "[" + text + "]" : text);
  }

  /// Empty when there is none.
  std::string picture_file(const BopImage& image) const {
    const BopScene& scene = scenes_[image.scene];
    std::error_code ignored;
    for (const char* kind : {"rgb", "gray"}) {
      for (const char* ending : {".png", ".jpg", ".jpeg", ".tif", ".tiff"}) {
        const std::string file = scene.place(kind, stem(image.image) + ending);
        if (fs::is_regular_file(folder_ / file, ignored)) return file;
      }
    }
    return {};
  }

  friend class BopImageReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::vector<BopScene> scenes_;
  std::vector<std::string> cameras_;  ///< Without a page.
  BopModelBoxes models_;
  std::map<std::string, std::string> names_;  ///< By obj_id.
  std::vector<BopImage> images_;              ///< While scenes are read.
  CaptureRows<BopImage> rows_;
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one image.
class BopImageReading : private FrameReading {
 public:
  BopImageReading(const BopDataset& dataset, const BopImage& image, const NameSet& wanted,
                  ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, image.capture,
                     dataset.info_.camera_names[image.camera], wanted, log),
        dataset_(dataset),
        scene_(dataset.scenes_[image.scene]),
        image_(image),
        stem_(dataset.stem(image.image)),
        is_own_(dataset.page_.has_value()) {}

  std::optional<Frame> read(FrameSources& sources) {
    if (!read_pictures(sources)) return std::nullopt;
    read_camera(sources);
    if (image_.has_poses) read_objects(sources);
    finish(sources);
    return std::move(frame_);
  }

  /// By id of the object; see StoredCapture::masks.
  std::map<std::uint32_t, CoverageMask> take_masks() { return std::move(lone_masks_); }

 private:
  /// False when no picture tells the size.
  bool read_pictures(FrameSources& sources) {
    const std::string file = dataset_.picture_file(image_);
    files_.check(!file.empty() || !scene_.has_pictures, kMissing, scene_.place("rgb", stem_), "",
                 "the picture is missing");
    bool has_size = false;
    if (!file.empty()) {
      // The depth tells the size as well.
      const bool is_needed = wants(kColor.name) || !wants(kDistanceToImagePlane.name);
      const auto picture = is_needed ? files_.picture(file) : std::nullopt;
      if (picture) {
        set_size(*picture);
        has_size = true;
        if (wants(kColor.name)) {
          frame_.set(kColor, picture->color());
          sources.emplace(kColor.name, file);
        }
      }
    }
    depth_file_ = scene_.place("depth", stem_ + ".png");
    for (const char* ending : {".tif", ".tiff"}) {  // ITODD's
      const std::string other = scene_.place("depth", stem_ + ending);
      if (!is_own_ && !files_.has(depth_file_) && files_.has(other)) depth_file_ = other;
    }
    if (scene_.has_depth && (wants(kDistanceToImagePlane.name) || !has_size)) {
      if (is_own_ || files_.has(depth_file_)) {
        depth_ = has_size ? files_.picture_of_size(depth_file_, frame_.camera.width,
                                                   frame_.camera.height, "the picture")
                          : files_.picture(depth_file_);
        if (depth_ && !has_size) set_size(*depth_);
        has_size = has_size || depth_.has_value();
      }
    }
    return has_size;
  }

  void read_camera(FrameSources& sources) {
    if (image_.camera_entry.length == 0) return;
    const std::string table = scene_.table("scene_camera");
    files_.reading(table, [&] {
      const Json json = dataset_.entry(table, image_.camera_entry, false);
      const std::string who = "image " + std::to_string(image_.image);
      const Json& k = json.at("cam_K");
      Camera& camera = frame_.camera;
      camera.fx = k.at(0).get<double>();
      camera.fy = k.at(4).get<double>();
      camera.cx = k.at(2).get<double>();
      camera.cy = k.at(5).get<double>();
      require_usable(camera);
      const bool is_upper = k.at(3) == 0.0 && k.at(6) == 0.0 && k.at(7) == 0.0 && k.at(8) == 1.0;
      files_.check(is_upper && (!is_own_ || k.at(1) == 0.0), kPose, table, who,
                   "its cam_K is no matrix of a camera");
      read_lens_entry(json, camera);
      sources.emplace(kHoldsCamera, table);
      if (json.contains("cam_R_w2c")) {
        Affine bop_from_world = Affine::Identity();
        bop_from_world.linear() = matrix_of(json.at("cam_R_w2c"));
        bop_from_world.translation() = kMetres * vector_of_json(json.at("cam_t_w2c"));
        files_.check(is_rotation(bop_from_world.linear(), is_own_ ? 1e-6 : 1e-2), kPose, table, who,
                     "cam_R_w2c is not a rotation");
        frame_.world_from_camera = (camera_from_bop() * bop_from_world).inverse();
        sources.emplace(kHoldsCameraPose, table);
      }
      const double scale =
          json.contains("depth_scale") ? json.at("depth_scale").get<double>() : 1.0;
      if (!(scale > 0.0) || !std::isfinite(scale)) {
        throw std::runtime_error(who + ": depth_scale is " + std::to_string(scale));
      }
      if (depth_ && wants(kDistanceToImagePlane.name)) set_depth(kMetres * scale, sources);
    });
  }

  void set_depth(double metres, FrameSources& sources) {
    Image<float> depth(depth_->width(), depth_->height(), std::numeric_limits<float>::infinity());
    for (int y = 0; y < depth.height(); ++y) {
      for (int x = 0; x < depth.width(); ++x) {
        const std::uint32_t value = depth_->at(x, y);
        if (value != 0) depth.at(x, y) = float(metres * double(value));
      }
    }
    frame_.set(kDistanceToImagePlane, std::move(depth));
    sources.emplace(kDistanceToImagePlane.name, depth_file_);
  }

  void read_objects(FrameSources& sources) {
    const std::string table = scene_.table("scene_gt");
    const std::string info_table = scene_.table("scene_gt_info");
    Json poses = Json::array();
    Json infos = Json::array();
    files_.reading(table, [&] { poses = dataset_.entry(table, image_.poses, true); });
    files_.reading(info_table, [&] { infos = dataset_.entry(info_table, image_.infos, true); });
    sources.emplace(kHoldsInstances, table);
    const std::string who = "image " + std::to_string(image_.image);
    if (image_.has_infos) {
      files_.check(poses.size() == infos.size(), kCounts, info_table, who,
                   "has " + std::to_string(infos.size()) + " entries",
                   std::to_string(poses.size()) + ", one per object");
      sources.emplace(kHoldsTightBoxes, info_table);
      sources.emplace(kHoldsOcclusion, info_table);
      sources.emplace(kHoldsAmodalBoxes, info_table);
    }
    for (std::size_t i = 0; i < poses.size(); ++i) {
      Instance instance;
      instance.id = std::uint32_t(i) + 1;
      instance.node_path = "/Assets/" + std::to_string(i + 1);
      files_.reading(table,
                     [&] { read_pose(poses[i], who + ", object " + std::to_string(i), instance); });
      masks_.emplace_back();
      const bool has_info = image_.has_infos && i < infos.size();
      files_.reading(info_table, [&] {
        read_masks(i, has_info ? infos[i] : Json(), who + ", object " + std::to_string(i),
                   instance);
      });
      frame_.instances.push_back(std::move(instance));
    }
  }

  void read_pose(const Json& pose, const std::string& who, Instance& instance) {
    const std::string table = scene_.table("scene_gt");
    const int id = whole_number<int>(pose.at("obj_id"));
    const auto model = dataset_.models_.find(id);
    files_.check(dataset_.models_.empty() ? !is_own_ : model != dataset_.models_.end(), kIds, table,
                 who, "its obj_id " + std::to_string(id) + " is not in models_info.json");
    const auto name = dataset_.names_.find(std::to_string(id));
    instance.labels["class"] =
        name != dataset_.names_.end() ? name->second : "obj_" + zero_padded(id, 6);
    if (pose.contains("node")) instance.node_path = pose.at("node").get<std::string>();
    const bool is_first = std::ranges::find(frame_.instances, instance.node_path,
                                            &Instance::node_path) == frame_.instances.end();
    files_.check(is_first, kOnce, table, who, instance.node_path + " is there a second time");
    Affine bop_from_model = Affine::Identity();
    bop_from_model.linear() = matrix_of(pose.at("cam_R_m2c"));
    bop_from_model.translation() = kMetres * vector_of_json(pose.at("cam_t_m2c"));
    files_.check(is_rotation(bop_from_model.linear(), is_own_ ? 1e-4 : 1e-2), kPose, table, who,
                 "cam_R_m2c is not a rotation");
    // Models are as large as their objects; what our writer's objects are scaled by stands beside.
    const Vec3 scale =
        pose.contains("scale") ? vector_of_json(pose.at("scale")) : Vec3(Vec3::Ones());
    if ((scale.array() == 0.0).any()) throw std::runtime_error(who + ": a scale is 0");
    instance.world_from_node =
        frame_.world_from_camera * camera_from_bop() * bop_from_model * Eigen::Scaling(scale);
    Aabb box;
    if (pose.contains("bounds_min")) {
      box = {vector_of_json(pose.at("bounds_min")), vector_of_json(pose.at("bounds_max"))};
      files_.check(!box.is_empty(), kCounts, table, who, "its bounds end before they begin");
      if (model != dataset_.models_.end()) {
        const double slack = 1e-5 * model->second.size().norm();
        files_.check(((box.min - model->second.min).array() >= -slack).all() &&
                         ((model->second.max - box.max).array() >= -slack).all(),
                     kCounts, table, who, "its bounds are not inside those of its model");
      }
    } else if (model != dataset_.models_.end()) {
      box = model->second;
    }
    if (box.is_empty()) return;
    instance.bounds_node.add(kMetres * box.min.cwiseQuotient(scale));
    instance.bounds_node.add(kMetres * box.max.cwiseQuotient(scale));
  }

  /// The pixels of a mask; nothing when it is not there or of another size.
  std::optional<CoverageMask> mask_of(const std::string& file) {
    const auto picture =
        files_.picture_of_size(file, frame_.camera.width, frame_.camera.height, "the picture");
    if (!picture) return std::nullopt;
    CoverageMask mask;
    mask.box = {0, 0, picture->width(), picture->height()};
    mask.bits.assign(std::size_t(picture->width()) * std::size_t(picture->height()), 0);
    std::int64_t other = 0;
    for (int y = 0; y < picture->height(); ++y) {
      for (int x = 0; x < picture->width(); ++x) {
        const std::uint32_t value = picture->at(x, y);
        if (value == 0) continue;
        mask.bits[mask.index(x, y)] = 1;
        if (value != 255 && value != 1) ++other;
      }
    }
    files_.check(other == 0 || !is_own_, kReadable, file, "",
                 std::to_string(other) + " pixels have another value than 0 and 255");
    const PixelBox extent = mask.extent();
    if (extent.is_empty()) return CoverageMask();
    return mask.cropped(extent);
  }

  void read_masks(std::size_t place, const Json& info, const std::string& who, Instance& instance) {
    const std::string table = scene_.table("scene_gt_info");
    const std::string name = stem_ + "_" + zero_padded(int(place), 6) + ".png";
    const bool wants_masks = wants(kInstanceId.name) || wants("amodal_mask") ||
                             wants(kHoldsOcclusion) || wants(kHoldsTruncation) ||
                             (!info.is_object() && wants(kHoldsTightBoxes));
    std::optional<CoverageMask> whole;
    if (wants_masks && scene_.has_visible_masks) {
      masks_.back() = mask_of(scene_.place("mask_visib", name));
    }
    if (wants_masks && scene_.has_masks) whole = mask_of(scene_.place("mask", name));
    const auto& seen = masks_.back();
    if (info.is_object()) {
      instance.tight_box = box_of(info.at("bbox_visib"));
      const auto visible = whole_number<std::int64_t>(info.at("px_count_visib"));
      if (visible == 0) instance.tight_box.reset();
      if (seen) {
        files_.check(pixel_count(*seen) == visible, kArea, table, who,
                     "its px_count_visib is " + std::to_string(visible),
                     "its mask has " + std::to_string(pixel_count(*seen)) + " pixels");
      }
      const auto all = whole_number<std::int64_t>(info.at("px_count_all"));
      const double share = info.at("visib_fract").get<double>();
      const double expected = all > 0 ? double(visible) / double(all) : 0.0;
      files_.check(std::abs(share - expected) < (is_own_ ? 1e-6 : 1e-3), kArea, table, who,
                   "its visib_fract is " + std::to_string(share),
                   std::to_string(expected) + ", px_count_visib / px_count_all");
      if (whole) check_silhouette(info, *whole, who);
      if (whole && all >= 0 && visible >= 0) {
        Visibility visibility;
        visibility.visible_pixels = visible;
        visibility.amodal_pixels = pixel_count(*whole);
        visibility.outside_pixels = std::max<std::int64_t>(all - visibility.amodal_pixels, 0);
        if (!whole->bits.empty()) visibility.amodal_box = whole->box;
        visibility.whole_box = box_of(info.at("bbox_obj"));
        visibility.amodal_mask = std::move(*whole);
        instance.visibility = std::move(visibility);
      }
    } else if (seen && !seen->bits.empty()) {
      instance.tight_box = seen->box;
    }
  }

  /// Of the silhouette only what lies inside the picture is in the mask.
  void check_silhouette(const Json& info, const CoverageMask& mask, const std::string& who) {
    const std::string table = scene_.table("scene_gt_info");
    const auto box = box_of(info.at("bbox_obj"));
    const std::int64_t count = pixel_count(mask);
    const auto all = whole_number<std::int64_t>(info.at("px_count_all"));
    if (!box) {
      files_.check(count == 0, kBox, table, who, "its bbox_obj is none",
                   "its mask extends over " + box_text(mask.box));
      return;
    }
    const PixelBox inside = box->clipped(frame_.camera.width, frame_.camera.height);
    const bool is_whole = inside == *box;
    const int slack = is_own_ ? 0 : 1;
    // What is cut off may be wider than what is left.
    const bool is_within =
        mask.box.x_min >= inside.x_min - slack && mask.box.y_min >= inside.y_min - slack &&
        mask.box.x_max <= inside.x_max + slack && mask.box.y_max <= inside.y_max + slack;
    const bool fits = is_whole && is_own_ ? *box == mask.box : count == 0 || is_within;
    files_.check(fits, kBox, table, who, "its bbox_obj is " + box_text(*box),
                 "its mask extends over " + box_text(mask.box));
    const bool counts = is_whole && is_own_ ? all == count : all >= count;
    files_.check(counts && (is_whole || all > count || !is_own_), kArea, table, who,
                 "its px_count_all is " + std::to_string(all),
                 "its mask has " + std::to_string(count) + " pixels" +
                     (is_whole ? "" : " of a silhouette that is cut off"));
    const auto valid = whole_number<std::int64_t>(info.at("px_count_valid"));
    std::int64_t measured = 0;
    if (depth_) {
      for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
        for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
          if (mask.bits[mask.index(x, y)] != 0 && depth_->at(x, y) != 0) ++measured;
        }
      }
    }
    files_.check(is_own_ && depth_ ? valid == measured : valid >= 0 && valid <= all, kArea, table,
                 who, "its px_count_valid is " + std::to_string(valid),
                 is_own_ && depth_ ? std::to_string(measured) + " pixels of its mask have a depth"
                                   : "at most px_count_all");
  }

  /// Ids, once all masks are known.
  void finish(FrameSources& sources) {
    if (!wants(kInstanceId.name) || !image_.has_poses) return;
    InstancePainter painter(frame_.camera.width, frame_.camera.height);
    bool have_all = true;
    for (std::size_t i = 0; i < masks_.size(); ++i) {
      have_all = have_all && masks_[i].has_value();
      if (!masks_[i]) continue;
      const std::int64_t shared = painter.paint(*masks_[i], frame_.instances[i].id);
      if (is_own_) {
        files_.check(shared == 0, kPartition, scene_.place("mask_visib", stem_),
                     "object " + std::to_string(i),
                     "shares " + std::to_string(shared) + " pixels with others");
      }
    }
    if (!have_all || painter.has_overlaps()) {
      for (std::size_t i = 0; i < masks_.size(); ++i) {
        if (masks_[i]) lone_masks_.emplace(frame_.instances[i].id, std::move(*masks_[i]));
      }
      return;
    }
    frame_.set(kInstanceId, painter.take());
    sources.emplace(kInstanceId.name, scene_.place("mask_visib", stem_));
  }

  const BopDataset& dataset_;
  const BopScene& scene_;
  const BopImage& image_;
  std::string stem_;
  bool is_own_;
  std::string depth_file_;
  std::optional<StoredPicture> depth_;
  std::vector<std::optional<CoverageMask>> masks_;  ///< What is seen of each object.
  std::map<std::uint32_t, CoverageMask> lone_masks_;
};

StoredCapture BopDataset::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(info_.captures.at(i), clips_of(page_), rows_.of(i),
                     [&](const BopImage& image, StoredCapture& stored, FrameSources& sources) {
                       const std::string& split = scenes_[image.scene].split;
                       // Our writer's validation captures are what the benchmark tests on.
                       stored.split = page_ && split == "test" ? "val" : split;
                       BopImageReading reading(*this, image, wanted, stored.log);
                       std::optional<Frame> frame = reading.read(sources);
                       if (frame) stored.masks.push_back(reading.take_masks());
                       return frame;
                     });
}

}  // namespace

std::vector<std::string> BopReader::patterns() const {
  return {"scene_camera*.json",     "scene_gt*.json",     "*/scene_camera*.json",
          "*/scene_gt*.json",       "*/*/scene_gt*.json", "*/*/scene_camera*.json",
          "models/models_info.json"};
}

Recognition BopReader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  const auto scenes = find_bop_scenes(folder);
  const bool has_tables = std::ranges::any_of(
      scenes, [](const BopScene& scene) { return scene.has_cameras || scene.has_poses; });
  return has_tables ? Recognition::ByFiles : Recognition::No;
}

std::unique_ptr<const StoredDataset> BopReader::open(const fs::path& folder) const {
  return std::make_unique<BopDataset>(folder, host_);
}

}  // namespace diorama
