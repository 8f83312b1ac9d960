// SPDX-License-Identifier: Apache-2.0
#include "writer_yolo/yolo_writer.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "diorama/error.h"
#include "opencv_support/contours.h"
#include "writer_support/cuboid.h"

namespace diorama {
namespace {

constexpr const char* kTasks[] = {"detect", "segment", "pose", "obb"};

void append_number(std::string& line, double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), " %.6f", value);
  line += text.data();
}

void append_point(std::string& line, const Frame& frame, const Vec2& point) {
  append_number(line, point.x() / frame.camera.width);
  append_number(line, point.y() / frame.camera.height);
}

/// `margin` is a share of the box's sides; edges go on to the next pixel, and not out of the
/// picture.
PixelBox with_margin(const PixelBox& box, double margin, const Camera& camera) {
  const double more_x = 0.5 * margin * box.width(), more_y = 0.5 * margin * box.height();
  const PixelBox looser{int(std::floor(box.x_min - more_x)), int(std::floor(box.y_min - more_y)),
                        int(std::ceil(box.x_max + more_x)), int(std::ceil(box.y_max + more_y))};
  return looser.clipped(camera.width, camera.height);
}

void append_box(std::string& line, const Frame& frame, const PixelBox& box) {
  append_point(line, frame, {0.5 * (box.x_min + box.x_max), 0.5 * (box.y_min + box.y_max)});
  append_point(line, frame, {double(box.width()), double(box.height())});
}

/// The named ones, if there are any, or those of the box.
void append_keypoints(std::string& line, const Frame& frame, const Instance& instance,
                      const std::vector<std::string>& names) {
  const auto append = [&](const ImagePoint& point) {
    append_point(line, frame, point.pixel);
    line += " " + std::to_string(int(point.state));
  };
  for (const std::string& name : names) append(named_point(frame, instance, name));
  if (!names.empty()) return;
  for (const CuboidPoint& keypoint : kCuboidKeypoints) {
    append(image_point(frame,
                       instance.world_from_node * keypoint_in_box(instance.bounds_node, keypoint)));
  }
}

}  // namespace

void YoloWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  training.visit_masks(v);
  v.choice("task", task, kTasks, {"What the label lines hold."});
  v.param(
      "box_margin", box_margin,
      {"Share by which boxes are wider and higher than what is seen, where a detector is to match "
       "boxes drawn by hand, which are looser.",
       "", 0, 10});
}

YoloWriter::YoloWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {
  const bool has_outlines = params_.task == "segment" || params_.task == "obb";
  if (has_outlines && !params_.training.masks) {
    throw Error(ErrorKind::Config, "task: " + params_.task +
                                       " is drawn round masks; 'masks: false' "
                                       "goes with detect and pose");
  }
}

NameSet YoloWriter::needs() const {
  NameSet names{std::string(kColor.name), "instances"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
  if (params_.task == "pose") names.emplace(kDistanceToCamera.name);
  return names;
}

void YoloWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  keypoints_.begin(dataset, training_);
  // Trainers insist on a validation folder.
  const std::string val = training_.splits().back();
  // Without `path`, which trainers would resolve against their own folder, splits lie beside it.
  std::string yaml = "train: images/train\nval: images/" + val + "\n";
  if (params_.task == "pose") {
    const std::size_t count =
        keypoints_.is_empty() ? std::size_t(kKeypointCount) : keypoints_.all().size();
    yaml += "kpt_shape: [" + std::to_string(count) + ", 3]\n";
  }
  yaml += "names:\n";
  for (std::size_t i = 0; i < training_.classes().size(); ++i) {
    yaml += "  " + std::to_string(i) + ": " + python_json(Json(training_.classes()[i])) + "\n";
  }
  files.add_text("data.yaml", yaml);
  Json more{{"task", params_.task}, {"labels", "shares of the image's width and height"}};
  if (params_.box_margin > 0.0) more["box_margin"] = params_.box_margin;
  if (params_.task == "pose") {
    if (keypoints_.is_empty()) {
      for (const CuboidPoint& point : kCuboidKeypoints) more["keypoints"].push_back(point.name);
    } else {
      more["keypoints"] = keypoints_.all();
    }
    more["keypoint_visibility"] = "0 outside the image, 1 hidden, 2 visible";
  }
  training_.add_dataset_page("YOLO", std::move(more), dataset, files);
}

std::string YoloWriter::line(const Frame& frame, const TrainingObject& object) const {
  const Instance& instance = *object.instance;
  std::string text = std::to_string(object.class_index);
  if (params_.task == "detect" || params_.task == "pose") {
    append_box(text, frame, with_margin(*instance.tight_box, params_.box_margin, frame.camera));
    if (params_.task == "pose") append_keypoints(text, frame, instance, keypoints_.all());
    return text;
  }
  const auto parts = outlines(frame.get(kInstanceId), instance.id, *instance.tight_box);
  if (params_.task == "segment") {
    for (const Vec2& point : joined(parts)) append_point(text, frame, point);
  } else {
    for (const Vec2& point : least_rectangle(parts)) append_point(text, frame, point);
  }
  return text;
}

void YoloWriter::write(const Capture& capture, CaptureFiles& files) const {
  const std::string split = training_.split(capture.index);
  for (const Frame& frame : capture.frames) {
    const std::string stem = training_.image_stem(capture, frame);
    files.add("images/" + split + "/" + stem + "." + training_.image_format(),
              training_.image_file(host_, frame));
    std::string labels;
    for (const TrainingObject& object : training_.objects(frame)) {
      labels += line(frame, object) + "\n";
    }
    files.add_text("labels/" + split + "/" + stem + ".txt", labels);
  }
}

}  // namespace diorama
