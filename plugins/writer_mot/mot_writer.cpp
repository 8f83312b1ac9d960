// SPDX-License-Identifier: Apache-2.0
#include "writer_mot/mot_writer.h"

#include <array>
#include <cstdio>

#include "writer_support/python_json.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

std::string track_line(int frame, const TrainingObject& object) {
  const Instance& instance = *object.instance;
  const PixelBox& box = *instance.tight_box;
  double visible = 1.0;
  if (instance.visibility) {
    const Visibility& seen = *instance.visibility;
    const auto whole = double(seen.amodal_pixels + seen.outside_pixels);
    if (whole > 0.0) visible = double(seen.visible_pixels) / whole;
  }
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "%d,%u,%d,%d,%d,%d,1,%d,%.6f\n", frame, instance.id,
                box.x_min + 1, box.y_min + 1, box.width(), box.height(), object.class_index + 1,
                visible);
  return text.data();
}

/// Tools read it as a whole number, which most rates are.
std::string frame_rate(double fps) {
  std::string text = python_float(fps);
  if (text.ends_with(".0")) text.resize(text.size() - 2);
  return text;
}

std::string sequence_page(const std::string& name, const Frame& frame, const ClipFrame& clip,
                          const std::string& ending) {
  return "[Sequence]\nname=" + name + "\nimDir=img1\nframeRate=" + frame_rate(clip.fps) +
         "\nseqLength=" + std::to_string(clip.frame_count) +
         "\nimWidth=" + std::to_string(frame.camera.width) +
         "\nimHeight=" + std::to_string(frame.camera.height) + "\nimExt=." + ending + "\n";
}

}  // namespace

void MotWriter::Params::visit(ParamVisitor& v) {
  training.visit(v);
  training.visit_masks(v);
}

MotWriter::MotWriter(Params params, Host& host)
    : params_(std::move(params)), host_(host), training_(params_.training) {}

NameSet MotWriter::needs() const {
  NameSet names{std::string(kColor.name), "instances", "visibility"};
  if (params_.training.masks) names.emplace(kInstanceId.name);
  return names;
}

void MotWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  training_.begin(dataset);
  training_.add_dataset_page(
      "MOT Challenge",
      {{"sequence", "one per clip and camera; captures in no clip are sequences of one frame"},
       {"track", "the number of the object's node, the same in all frames of a clip"},
       {"pixels_of_gt", "1 is the first column and row, as are frames and classes"},
       {"visibility", "share of the whole object that is neither hidden nor out of the picture"}},
      dataset, files);
}

void MotWriter::write(const Capture& capture, CaptureFiles& files) const {
  const ClipFrame clip = capture.clip.value_or(ClipFrame());
  const std::string front =
      std::string(training_.split(capture.index)) + "/" +
      (capture.clip ? "clip_" + padded(clip.clip, 4) : "capture_" + padded(capture.index, 6)) + "_";
  Json record = Json::object();
  for (const Frame& frame : capture.frames) {
    const std::string sequence = front + frame.camera_name;
    files.add(sequence + "/img1/" + padded(clip.frame + 1, 6) + "." + training_.image_format(),
              training_.image_file(host_, frame));
    std::string lines;
    for (const TrainingObject& object : training_.objects(frame)) {
      lines += track_line(clip.frame + 1, object);
    }
    record[sequence] = {{"lines", lines}};
    if (clip.frame > 0) continue;
    record[sequence]["page"] = sequence_page(sequence.substr(sequence.find('/') + 1), frame, clip,
                                             training_.image_format());
  }
  files.record(record.dump());
}

void MotWriter::finish(const RecordReader& records, DatasetFiles& files) {
  records([&](int, std::string_view line) {
    const Json record = Json::parse(line);
    for (const auto& [sequence, entry] : record.items()) {
      // A sequence without objects has an empty list, not none.
      files.append_text(sequence + "/gt/gt.txt", entry.at("lines").get<std::string>());
      if (!entry.contains("page")) continue;
      files.add_text(sequence + "/seqinfo.ini", entry.at("page").get<std::string>());
    }
  });
}

}  // namespace diorama
