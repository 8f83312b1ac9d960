// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/pose_writer.h"

#include "writer_pose/overlay.h"
#include "writer_pose/pose_json.h"
#include "writer_support/clips_json.h"
#include "writer_support/image_files.h"

namespace diorama {
namespace {

constexpr const char* kCompatWords[] = {"none", "replicator"};

PoseLayout read_layout(const std::optional<std::string>& format) {
  if (!format) return PoseLayout::Full;
  std::string lower = *format;
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  }
  if (lower == "none") return PoseLayout::Full;
  if (lower == "dope") return PoseLayout::Dope;
  if (lower == "centerpose") return PoseLayout::CenterPose;
  throw Error(ErrorKind::Config,
              "format: expected null, dope or centerpose, found '" + *format + "'");
}

}  // namespace

void PoseWriter::Params::visit(ParamVisitor& v) {
  v.param("use_subfolders", use_subfolders, {"One folder per camera; else cameras take turns."});
  v.param("visibility_threshold", visibility_threshold,
          {"Objects with this visible share or less are left out.", "", 0.0, 1.0});
  v.param("skip_empty_frames", skip_empty_frames, {"No files for a frame without objects."});
  v.param("write_debug_images", write_debug_images, {"Pictures with cuboids and axes drawn in."});
  v.param("frame_padding", frame_padding,
          {"Least digits of the frame number; more where the job needs them.", "", 0, 20});
  v.param("format", format, {"null for all fields, or the fields of dope or centerpose."});
  v.choice("image_output_format", image_output_format, kImageEndings, {"Format of the pictures."});
  v.choice("compat", compat, kCompatWords,
           {"replicator repeats the reference's swapped camera pose and undistorted pixels."});
  v.param("named_keypoints", named_keypoints,
          {"Adds the keypoints that the job names for its objects, seen or not."});
  v.param("use_s3", use_s3, {"Accepted as false only: files go to the output folder."});
  v.param("s3_endpoint_url", s3_endpoint_url,
          {"Accepted as null only: files go to the output folder."});
  remote.visit(v);
}

PoseWriter::PoseWriter(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      format_{read_layout(params_.format), params_.compat == "replicator", params_.named_keypoints},
      filter_(SemanticFilter::parse("class:*")),
      frame_padding_(params_.frame_padding) {
  params_.remote.check();
  if (params_.use_s3 || params_.s3_endpoint_url) {
    throw Error(ErrorKind::Config,
                "use_s3, s3_endpoint_url: files go to the output folder only, remove the keys");
  }
}

NameSet PoseWriter::needs() const {
  NameSet names{"instances", "visibility", std::string(kInstanceId.name)};
  if (params_.named_keypoints) names.emplace(kDistanceToCamera.name);
  if (params_.image_output_format == "exr") {
    names.emplace(kColorHdr.name);
    if (params_.write_debug_images) names.emplace(kColor.name);
  } else {
    names.emplace(kColor.name);
  }
  return names;
}

void PoseWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  const int cameras = params_.use_subfolders ? 1 : int(dataset.camera_names.size());
  frame_padding_ = grown_padding(params_.frame_padding, dataset.capture_count * cameras);
  const bool take_turns = cameras > 1 && !format_.is_replicator;
  add_replicator_metadata("PoseWriter", "0.2.0", dataset, files,
                          take_turns ? dataset.camera_names : std::vector<std::string>());
}

/// Cameras take turns in one folder. A skipped frame keeps its number, so that names follow from
/// the capture alone.
std::string PoseWriter::stem(const Capture& capture, std::size_t camera) const {
  if (params_.use_subfolders) {
    return render_product_name(capture.frames[camera]) + "/" +
           padded(capture.index, frame_padding_);
  }
  return padded(capture.index * int(capture.frames.size()) + int(camera), frame_padding_);
}

void PoseWriter::write(const Capture& capture, CaptureFiles& files) const {
  for (std::size_t camera = 0; camera < capture.frames.size(); ++camera) {
    write_frame(capture, capture.frames[camera], stem(capture, camera), files);
  }
}

void PoseWriter::write_frame(const Capture& capture, const Frame& frame, const std::string& stem,
                             CaptureFiles& files) const {
  const auto objects = object_poses(frame, filter_, format_, params_.visibility_threshold);
  if (objects.empty() && params_.skip_empty_frames) return;
  Json json = pose_json(frame, objects, format_);
  add_clip_frame(capture, json);
  files.add_text(stem + ".json", python_json(json, 2));
  if (params_.image_output_format == "exr") {
    files.add(stem + ".exr", exr_file(host_, frame.get(kColorHdr)));
  } else {
    add_picture(stem, frame.get(kColor), files);
  }
  if (params_.write_debug_images) {
    add_picture(stem + "_overlay", draw_overlay(frame, objects, format_.layout), files);
  }
}

void PoseWriter::add_picture(const std::string& stem, const Image<Rgba8>& picture,
                             CaptureFiles& files) const {
  // Drawings have no HDR form: beside EXR pictures they are PNG.
  const bool is_png = params_.image_output_format == "png" || params_.image_output_format == "exr";
  const std::string ending = is_png ? "png" : params_.image_output_format;
  files.add(stem + "." + ending, is_png ? png_file(host_, picture) : jpeg_file(host_, picture));
}

}  // namespace diorama
