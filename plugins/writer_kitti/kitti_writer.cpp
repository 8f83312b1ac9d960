// SPDX-License-Identifier: Apache-2.0
#include "writer_kitti/kitti_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "diorama/error.h"
#include "writer_support/cuboid.h"
#include "writer_support/image_files.h"
#include "writer_support/lens_json.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

constexpr const char* kLayouts[] = {"mono", "stereo", "tracking"};

/// KITTI's camera axes from ours: y and z change sign.
Vec3 kitti_from_camera(const Vec3& p) { return {p.x(), -p.y(), -p.z()}; }

struct UprightBox {
  Vec3 size;      ///< Length along the heading, height, width.
  Vec3 location;  ///< Middle of the bottom face.
  double rotation_y = 0.0;
};

/// What the benchmark writes where it knows nothing.
const UprightBox kUnknownBox{Vec3::Constant(-1.0), Vec3::Constant(-1000.0), -10.0};

/// Turns about y by `angle`: the heading (cos, 0, -sin) becomes x.
Vec3 unturned(const Vec3& p, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * p.x() - s * p.z(), p.y(), s * p.x() + c * p.z()};
}

UprightBox upright_box(const Frame& frame, const Instance& instance) {
  const Affine camera_from_node = frame.world_from_camera.inverse() * instance.world_from_node;
  const Vec3 heading = kitti_from_camera(camera_from_node.linear().col(0));
  UprightBox box;
  box.rotation_y = std::atan2(-heading.z(), heading.x());
  Aabb extent;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner = kitti_from_camera(camera_from_node * instance.bounds_node.corner(i));
    extent.add(unturned(corner, box.rotation_y));
  }
  box.size = extent.size();
  Vec3 bottom = extent.centre();
  bottom.y() = extent.max.y();
  box.location = unturned(bottom, -box.rotation_y);
  return box;
}

/// 0 fully visible, 1 partly hidden, 2 largely hidden, 3 unknown.
int occlusion_level(const Instance& instance, const KittiWriter::Params& limits) {
  if (!instance.visibility && !limits.training.masks) return 3;
  const double visible =
      instance.visibility ? 1.0 - instance.visibility->occlusion().value_or(0.0) : 1.0;
  if (visible >= limits.fully_visible_threshold) return 0;
  return visible >= limits.partly_occluded_threshold ? 1 : 2;
}

/// 0 none, 1 up to half, 2 more of it is outside of the picture, -1 unknown.
int truncation_level(const Instance& instance, const KittiWriter::Params& limits) {
  if (!instance.visibility && !limits.training.masks) return -1;
  const double truncation = instance.visibility ? instance.visibility->truncation() : 0.0;
  return truncation <= 0.0 ? 0 : truncation <= 0.5 ? 1 : 2;
}

/// The class, and the fields behind the truncation.
struct LabelText {
  std::string name;
  std::string fields;
};

LabelText label_text(const Frame& frame, const TrainingObject& object, const std::string& name,
                     const KittiWriter::Params& limits) {
  const Instance& instance = *object.instance;
  UprightBox box = kUnknownBox;
  double alpha = kUnknownBox.rotation_y;
  if (has_extent(instance)) {
    box = upright_box(frame, instance);
    const double bearing = std::atan2(box.location.x(), box.location.z());
    alpha = std::remainder(box.rotation_y - bearing, 2.0 * kPi);
  }
  const PixelBox& pixels = *instance.tight_box;
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(),
                " %d %.2f %d.00 %d.00 %d.00 %d.00 %.4f %.4f %.4f %.4f %.4f %.4f %.4f\n",
                occlusion_level(instance, limits), alpha, pixels.x_min, pixels.y_min, pixels.x_max,
                pixels.y_max, box.size.y(), box.size.z(), box.size.x(), box.location.x(),
                box.location.y(), box.location.z(), box.rotation_y);
  // Fields are separated by spaces.
  std::string word = name;
  std::ranges::replace(word, ' ', '_');
  return {word, text.data()};
}

std::string label_line(const Frame& frame, const TrainingObject& object, const std::string& name,
                       const KittiWriter::Params& limits) {
  const LabelText label = label_text(frame, object, name, limits);
  const auto& visibility = object.instance->visibility;
  std::array<char, 32> truncation{};
  std::snprintf(truncation.data(), truncation.size(), " %.2f",
                visibility              ? visibility->truncation()
                : limits.training.masks ? 0.0
                                        : -1.0);
  return label.name + truncation.data() + label.fields;
}

std::string track_line(const Frame& frame, int number, const TrainingObject& object,
                       const std::string& name, const KittiWriter::Params& limits) {
  const LabelText label = label_text(frame, object, name, limits);
  return std::to_string(number) + " " + std::to_string(object.instance->id) + " " + label.name +
         " " + std::to_string(truncation_level(*object.instance, limits)) + label.fields;
}

/// From the left camera to the right one, in metres. Pictures are rectified: rows of both show the
/// same, and all that differs is the place along x.
double baseline_of(const Frame& left, const Frame& right) {
  const Camera& a = left.camera;
  const Camera& b = right.camera;
  const auto fail = [&](const std::string& found) {
    throw Error(ErrorKind::Config,
                "layout: stereo: '" + right.camera_name + "' " + found + " '" + left.camera_name +
                    "', expected equal pinhole cameras by twos, left before right, as in rig: "
                    "[{name: left}, {name: right, position: [0.54, 0, 0]}]");
  };
  const bool has_same_lens = a.width == b.width && a.height == b.height && a.fx == b.fx &&
                             a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
                             a.lens == LensModel::Pinhole && b.lens == LensModel::Pinhole;
  if (!has_same_lens) fail("has another lens or size than");
  const Affine left_from_right = left.world_from_camera.inverse() * right.world_from_camera;
  const Vec3 place = left_from_right.translation();
  const double turn = (left_from_right.linear() - Mat3::Identity()).norm();
  const bool is_right = place.x() > 0.0 && place.tail<2>().norm() <= 1e-6 * place.norm();
  if (turn > 1e-6 || !is_right) fail("does not stand to the right of and parallel to");
  return place.x();
}

/// P1 and P3 are those of the camera to the right, if there is one: `baseline_m` above 0.
std::string calibration(const Camera& camera, double baseline_m) {
  const Intrinsics k = intrinsics_of(camera);
  std::string text;
  for (int i = 0; i < 4; ++i) {
    std::array<char, 32> shift{"0"};
    if (i % 2 == 1 && baseline_m > 0.0) {
      std::snprintf(shift.data(), shift.size(), "%.12e", -k.fx * baseline_m);
    }
    std::array<char, 256> p{};
    std::snprintf(p.data(), p.size(), "P%d: %.12e 0 %.12e %s 0 %.12e %.12e 0 0 0 1 0\n", i, k.fx,
                  k.cx, shift.data(), k.fy, k.cy);
    text += p.data();
  }
  text +=
      "R0_rect: 1 0 0 0 1 0 0 0 1\n"
      "Tr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0\n"
      "Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n";
  // Last, because readers count the standard lines.
  if (camera.lens != LensModel::Pinhole) {
    text += "lens_2: " + python_json(lens_json(camera)) + "\n";
  }
  return text;
}

Image<std::uint32_t> depth_picture(const Image<float>& depth) {
  Image<std::uint32_t> picture(depth.width(), depth.height(), 0);
  for (std::size_t i = 0; i < depth.pixels().size(); ++i) {
    const double value = std::round(256.0 * double(depth.pixels()[i]));
    if (value <= 65535.0) picture.pixels()[i] = std::uint32_t(value);
  }
  return picture;
}

/// Every second camera.
std::vector<std::string> left_cameras(const DatasetInfo& dataset) {
  if (dataset.camera_names.size() % 2 != 0) {
    throw Error(ErrorKind::Config,
                "layout: stereo takes cameras by twos, left before right; the job has " +
                    std::to_string(dataset.camera_names.size()));
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < dataset.camera_names.size(); i += 2) {
    names.push_back(dataset.camera_names[i]);
  }
  return names;
}

}  // namespace

void KittiWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  training.visit_masks(v);
  v.param("depth", depth, {"Depth pictures, 16 bit, metres x 256."});
  v.choice(
      "layout", layout, kLayouts,
      {"mono: each camera's pictures are image_2; stereo: cameras go by twos, left before right, "
       "and the right one's picture is image_3; tracking: of clips, each camera's a sequence of "
       "the tracking benchmark."});
  v.param("bbox_height_threshold", bbox_height_threshold,
          {"Objects whose 2-D box is lower are left out.", "px", 0});
  v.param("fully_visible_threshold", fully_visible_threshold,
          {"Objects of which at least this share is visible are not occluded.", "", 0, 1});
  v.param("partly_occluded_threshold", partly_occluded_threshold,
          {"Objects of which less is visible are largely occluded.", "", 0, 1});
  v.param("omit_semantic_type", omit_semantic_type, {"Accepted; labels never say their taxonomy."});
  v.param("use_kitti_dir_names", use_kitti_dir_names,
          {"Accepted; folders always have the benchmark's names."});
  v.param("colorize_instance_segmentation", colorize_instance_segmentation,
          {"Accepted; there are no segmentation pictures."});
  v.param("mapping_path", mapping_path, {"Accepted; there are no segmentation pictures."});
  v.param("mapping_dict", mapping_dict, {"Accepted; there are no segmentation pictures."});
  v.param("renderproduct_idxs", renderproduct_idxs, {"Accepted; every camera is written."});
  labels.visit(v);
  remote.visit(v);
}

KittiWriter::KittiWriter(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      training_(params_.training, params_.labels.choice(params_.training.taxonomy)) {
  params_.remote.check();
  notice_idle_keywords();
}

void KittiWriter::notice_idle_keywords() const {
  const auto notice = [&](bool is_asked_for, const char* text) {
    if (is_asked_for) host_.log(LogLevel::Info, std::string("KittiWriter: ") + text);
  };
  const bool has_mapping =
      params_.mapping_path.has_value() || params_.mapping_dict.kind != Value::Kind::Null;
  notice(!params_.omit_semantic_type,
         "omit_semantic_type: false has no effect: labels never say their taxonomy");
  notice(!params_.use_kitti_dir_names,
         "use_kitti_dir_names: false has no effect: folders have the benchmark's names");
  notice(has_mapping || params_.colorize_instance_segmentation,
         "there are no segmentation pictures whose colours could be chosen");
  notice(params_.renderproduct_idxs.kind != Value::Kind::Null,
         "renderproduct_idxs has no effect: every camera is written");
}

NameSet KittiWriter::needs() const {
  NameSet names{std::string(kColor.name), "instances", "visibility"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
  if (params_.depth) names.emplace(kDistanceToImagePlane.name);
  return names;
}

std::string KittiWriter::stem(int capture, int camera) const {
  return padded(capture * training_.camera_count() + camera, padding_);
}

void KittiWriter::begin(const DatasetInfo& all, DatasetFiles& files) {
  DatasetInfo dataset = all;
  if (is_stereo()) dataset.camera_names = left_cameras(all);
  training_.begin(dataset);
  nlohmann::ordered_json unknown = nlohmann::ordered_json::object();
  if (!params_.training.masks) {
    unknown["unknown"] =
        "truncation -1, occlusion 3, alpha and rotation_y -10, dimensions -1, location -1000";
  }
  if (is_tracking()) {
    for (int i = 0; i < dataset.capture_count; ++i) {
      if (clip_frame(dataset.clips, i)) continue;
      throw Error(ErrorKind::Config, "layout: tracking: capture " + std::to_string(i) +
                                         " is in no clip; only a step 'record' of the timeline "
                                         "makes sequences");
    }
    nlohmann::ordered_json conventions{
        {"camera_axes", "x right, y down, z forward"},
        {"rotations", "rotation_y about the camera's y axis, radians; there are no quaternions"},
        {"dimensions", "height, width, length in metres; length along the object's x axis"},
        {"location", "middle of the bottom face in the camera's space"},
        {"sequence", "clip x cameras + camera"},
        {"track", "the number of the object's node, the same in all frames of a clip"},
        {"depth", "along the viewing axis, metres x 256 in 16 bit, 0: nothing"}};
    conventions.update(unknown);
    training_.add_dataset_page("KITTI tracking", std::move(conventions), dataset, files);
    return;
  }
  padding_ = grown_padding(6, dataset.capture_count * training_.camera_count());
  std::string train, val, both;
  for (int capture = 0; capture < dataset.capture_count; ++capture) {
    for (int camera = 0; camera < training_.camera_count(); ++camera) {
      const std::string line = stem(capture, camera) + "\n";
      (std::string_view(training_.split(capture)) == "val" ? val : train) += line;
      both += line;
    }
  }
  files.add_text("ImageSets/train.txt", train);
  files.add_text("ImageSets/val.txt", val);
  files.add_text("ImageSets/trainval.txt", both);
  nlohmann::ordered_json conventions{
      {"camera_axes", "x right, y down, z forward"},
      {"rotations", "rotation_y about the camera's y axis, radians; there are no quaternions"},
      {"dimensions", "height, width, length in metres; length along the object's x axis"},
      {"location", "middle of the bottom face in the camera's space"},
      {"number", "capture x cameras + camera"},
      {"depth", "along the viewing axis, metres x 256 in 16 bit, 0: nothing"}};
  if (is_stereo()) {
    conventions["image_3"] = "the camera to the right; P1 and P3 hold -fx x baseline in metres";
  }
  conventions.update(unknown);
  training_.add_dataset_page("KITTI", std::move(conventions), dataset, files);
}

void KittiWriter::write_clip_frame(const Capture& capture, CaptureFiles& files) const {
  const ClipFrame clip = capture.clip.value();
  Json record = Json::object();
  for (std::size_t i = 0; i < capture.frames.size(); ++i) {
    const Frame& frame = capture.frames[i];
    const std::string sequence = padded(clip.clip * training_.camera_count() + int(i), 4);
    const std::string name = sequence + "/" + padded(clip.frame, 6);
    files.add("training/image_02/" + name + "." + training_.image_format(),
              training_.image_file(host_, frame));
    std::string labels;
    for (const TrainingObject& object : training_.objects(frame)) {
      if (object.instance->tight_box->height() < params_.bbox_height_threshold) continue;
      labels += track_line(frame, clip.frame, object,
                           training_.classes()[std::size_t(object.class_index)], params_);
    }
    record[sequence] = {{"labels", labels}};
    if (clip.frame == 0) record[sequence]["calib"] = calibration(frame.camera, 0.0);
    if (params_.depth) {
      const std::string path = "training/depth_02/" + name + ".png";
      files.add(path, png_file(host_, depth_picture(frame.get(kDistanceToImagePlane)), path));
    }
  }
  files.record(record.dump());
}

void KittiWriter::finish(const RecordReader& records, DatasetFiles& files) {
  if (!is_tracking()) return;
  records([&](int, std::string_view line) {
    const Json record = Json::parse(line);
    for (const auto& [sequence, entry] : record.items()) {
      files.append_text("training/label_02/" + sequence + ".txt",
                        entry.at("labels").get<std::string>());
      if (!entry.contains("calib")) continue;
      files.add_text("training/calib/" + sequence + ".txt", entry.at("calib").get<std::string>());
    }
  });
}

void KittiWriter::write(const Capture& capture, CaptureFiles& files) const {
  if (is_tracking()) return write_clip_frame(capture, files);
  const std::size_t step = is_stereo() ? 2 : 1;
  for (std::size_t i = 0; i + step <= capture.frames.size(); i += step) {
    const Frame& frame = capture.frames[i];
    const std::string name = stem(capture.index, int(i / step));
    double baseline_m = 0.0;
    if (is_stereo()) {
      const Frame& right = capture.frames[i + 1];
      baseline_m = baseline_of(frame, right);
      files.add("training/image_3/" + name + "." + training_.image_format(),
                training_.image_file(host_, right));
    }
    files.add("training/image_2/" + name + "." + training_.image_format(),
              training_.image_file(host_, frame));
    std::string labels;
    for (const TrainingObject& object : training_.objects(frame)) {
      if (object.instance->tight_box->height() < params_.bbox_height_threshold) continue;
      labels +=
          label_line(frame, object, training_.classes()[std::size_t(object.class_index)], params_);
    }
    files.add_text("training/label_2/" + name + ".txt", labels);
    files.add_text("training/calib/" + name + ".txt", calibration(frame.camera, baseline_m));
    if (params_.depth) {
      const std::string path = "training/depth_2/" + name + ".png";
      files.add(path, png_file(host_, depth_picture(frame.get(kDistanceToImagePlane)), path));
    }
  }
}

}  // namespace diorama
