// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/basic_writer.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "writer_basic/box_files.h"
#include "writer_basic/camera_params.h"
#include "writer_basic/frame_output.h"
#include "writer_basic/joint_states.h"
#include "writer_basic/point_cloud_files.h"
#include "writer_basic/segmentation_files.h"
#include "writer_support/clips_json.h"
#include "writer_support/image_files.h"
#include "writer_support/npy.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

void write_rgb(const FrameOutput& output, const std::string& format) {
  const std::string path = output.path("rgb", "rgb", "." + format);
  if (format == "exr") {
    output.files.add(path, exr_file(output.host, output.frame.get(kColorHdr)));
  } else if (format == "png") {
    output.files.add(path, png_file(output.host, output.frame.get(kColor)));
  } else {
    output.files.add(path, jpeg_file(output.host, output.frame.get(kColor)));
  }
}

void write_distance(const FrameOutput& output, const Channel<float>& channel, bool colorize) {
  add_npy(output.files, output.path(channel.name, channel.name, ".npy"),
          output.frame.image_named(channel.name));
  if (!colorize) return;
  auto distances = output.frame.get(channel);
  // What a sensor does not measure looks like what no ray met.
  std::ranges::replace(distances.pixels(), 0.0f, std::numeric_limits<float>::infinity());
  output.files.add(
      output.path(channel.name, channel.name, ".png"),
      png_file(output.host, distances.width(), distances.height(), distance_picture(distances)));
}

/// Row by row: the format's four numbers per pixel are twice what the channel takes.
void write_motion_vectors(const FrameOutput& output) {
  const auto& motion = output.frame.get(kMotion);
  const std::string path = output.path("motion_vectors", "motion_vectors", ".npy");
  const std::array<std::int64_t, 3> shape{motion.height(), motion.width(), 4};
  output.files.append(path, npy_header("'<f4'", shape));
  std::vector<std::array<float, 4>> row(std::size_t(motion.width()));
  for (int y = 0; y < motion.height(); ++y) {
    // The format counts motion to the left and up; 0 - x keeps zero positive.
    std::ranges::transform(motion.row(y), row.begin(), [](const Vec2f& pixels) {
      return std::array{0.0f - pixels.x(), 0.0f - pixels.y(), 0.0f, 0.0f};
    });
    output.files.append(path, std::as_bytes(std::span(row)));
  }
}

/// By path; what is no part of a rigid body has no velocity.
void write_velocities(const FrameOutput& output) {
  Json velocities = Json::object();
  for (const FilteredInstance& filtered : output.instances) {
    const Instance& instance = *filtered.instance;
    if (!instance.velocity) continue;
    velocities[instance.node_path] = {{"linear", flat_list(instance.velocity->linear)},
                                      {"angular", flat_list(instance.velocity->angular)}};
  }
  output.files.add_text(output.path("velocities", "velocities", ".json"), python_json(velocities));
}

void write_unlabelled_files(const BasicWriter::Params& params, const FrameOutput& output) {
  if (params.rgb) write_rgb(output, params.image_output_format);
  if (params.sensor_depth) write_distance(output, kSensorDepth, params.colorize_depth);
  if (params.normals) {
    output.files.add(output.path("normals", "normals", ".png"),
                     png_file(output.host, normals_picture(output.frame.get(kNormals))));
  }
  if (params.distance_to_camera) {
    write_distance(output, kDistanceToCamera, params.colorize_depth);
  }
  if (params.distance_to_image_plane) {
    write_distance(output, kDistanceToImagePlane, params.colorize_depth);
  }
  if (params.instance_id_segmentation) {
    write_instance_id_segmentation(output, params.colorize_instance_id_segmentation,
                                   params.no_instance_text);
  }
  if (params.motion_vectors) write_motion_vectors(output);
  if (params.camera_params) {
    output.files.add_text(output.path("camera_params", "camera_params", ".json"),
                          python_json(camera_params_json(output.frame)));
  }
  if (params.joint_states) {
    output.files.add_text(output.path("joint_states", "joint_states", ".json"),
                          python_json(joint_states_json(output.frame)));
  }
  if (params.pointcloud) write_point_cloud(output, params.pointcloud_include_unlabelled);
  for (const std::string& channel : params.channels.names) {
    add_npy(output.files, output.path(channel, channel, ".npy"), output.frame.image_named(channel));
  }
}

void write_labelled_files(const BasicWriter::Params& params, const FrameOutput& output) {
  if (params.semantic_segmentation) {
    write_semantic_segmentation(output, params.colorize_semantic_segmentation);
  }
  if (params.instance_segmentation) {
    write_instance_segmentation(output, params.colorize_instance_segmentation);
  }
  if (params.bounding_box_2d_tight) write_bounding_box_2d_tight(output);
  if (params.bounding_box_2d_loose) write_bounding_box_2d_loose(output);
  if (params.bounding_box_3d) write_bounding_box_3d(output);
  if (params.occlusion) write_occlusion(output);
  if (params.velocities) write_velocities(output);
}

}  // namespace

void BasicWriter::Params::visit(ParamVisitor& v) {
  v.param("rgb", rgb, {"Pictures, sRGB with alpha 255; as EXR the linear radiance."});
  v.param("bounding_box_2d_tight", bounding_box_2d_tight, {"Boxes round the visible pixels."});
  v.param("bounding_box_2d_loose", bounding_box_2d_loose,
          {"Boxes round whole objects, as if nothing hid them, inside the image."});
  v.param("semantic_segmentation", semantic_segmentation, {"One id per distinct label set."});
  v.param("instance_id_segmentation", instance_id_segmentation,
          {"One id per mesh node, labelled or not."});
  v.param("instance_segmentation", instance_segmentation, {"One id per labelled node."});
  v.param("distance_to_camera", distance_to_camera, {"Distance from the camera's centre."});
  v.param("distance_to_image_plane", distance_to_image_plane, {"Depth along the viewing axis."});
  v.param("bounding_box_3d", bounding_box_3d, {"Boxes in node space with the node's pose."});
  v.param("occlusion", occlusion, {"Hidden share of each object."});
  v.param("normals", normals, {"World normals as a picture."});
  v.param("motion_vectors", motion_vectors, {"Pixel motion since the previous time step."});
  v.param("camera_params", camera_params, {"Lens, sensor, projection and pose."});
  v.param("joint_states", joint_states,
          {"Joints: kind, bodies, position and limits, in radians and metres."});
  v.param("pointcloud", pointcloud, {"World points of the pixels with colours, normals and ids."});
  v.param("skeleton_data", skeleton_data,
          {"Accepted; scenes hold no skeletons, so no file is written."});
  v.param("pointcloud_include_unlabelled", pointcloud_include_unlabelled,
          {"Points of unlabelled surfaces too."});
  v.param("sensor_depth", sensor_depth,
          {"Depth as the annotator depth_sensor measures it, 0 where it measures nothing."});
  v.param("velocities", velocities, {"How objects move and turn, m/s and rad/s in the world."});
  channels.visit(v);
  v.choice("image_output_format", image_output_format, kImageEndings,
           {"Format of the rgb files; all other pictures are PNG."});
  v.param("colorize_semantic_segmentation", colorize_semantic_segmentation,
          {"Colours instead of ids."});
  v.param("colorize_instance_id_segmentation", colorize_instance_id_segmentation,
          {"Colours instead of ids."});
  v.param("colorize_instance_segmentation", colorize_instance_segmentation,
          {"Colours instead of ids."});
  v.param("colorize_depth", colorize_depth, {"A gray picture beside each distance file."});
  v.param("frame_padding", frame_padding,
          {"Least digits of the frame number; more where the job needs them.", "", 0, 20});
  v.param("semantic_types", semantic_types,
          {"List of taxonomies whose labels count; null or empty: class. Excludes "
           "semantic_filter_predicate."});
  v.param("semantic_filter_predicate", semantic_filter_predicate,
          {"Which labels count, such as 'class: car & !broken; shape: *'."});
  v.param("use_common_output_dir", use_common_output_dir,
          {"With several cameras: one folder per annotator instead of one per camera."});
  v.param("no_instance_text", no_instance_text,
          {"What instance_id_segmentation calls the background; some releases wrote BACKGROUND."});
  remote.visit(v);
}

BasicWriter::BasicWriter(Params params, Host& host)
    : params_(std::move(params)),
      host_(host),
      filter_(SemanticFilter::from_params(texts_or_null(params_.semantic_types, "semantic_types"),
                                          params_.semantic_filter_predicate)),
      frame_padding_(params_.frame_padding) {
  params_.remote.check();
  std::vector<std::string_view> taken{"pointcloud", "motion_vectors"};
  const auto take = [&taken](bool is_written, std::string_view name) {
    if (is_written) taken.push_back(name);
  };
  take(params_.distance_to_camera, kDistanceToCamera.name);
  take(params_.distance_to_image_plane, kDistanceToImagePlane.name);
  take(params_.sensor_depth, kSensorDepth.name);
  params_.channels.check(taken);
}

NameSet BasicWriter::needs() const {
  NameSet names{"instances"};
  const auto add = [&names](bool wanted, std::initializer_list<std::string_view> more) {
    if (wanted) names.insert(more.begin(), more.end());
  };
  const Params& p = params_;
  add(p.rgb, {p.image_output_format == "exr" ? kColorHdr.name : kColor.name});
  add(p.semantic_segmentation || p.instance_segmentation, {kLeafId.name, kInstanceId.name});
  add(p.instance_id_segmentation, {kLeafId.name});
  add(p.distance_to_camera, {kDistanceToCamera.name});
  add(p.distance_to_image_plane, {kDistanceToImagePlane.name});
  add(p.sensor_depth, {kSensorDepth.name});
  add(p.normals, {kNormals.name});
  add(p.motion_vectors, {kMotion.name});
  add(p.pointcloud, {kPosition.name, kColor.name, kNormals.name, kLeafId.name, kInstanceId.name});
  p.channels.add_to(names);
  add(p.bounding_box_2d_tight || p.bounding_box_2d_loose || p.bounding_box_3d || p.occlusion,
      {kInstanceId.name, "visibility"});
  return names;
}

void BasicWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  frame_padding_ = grown_padding(params_.frame_padding, dataset.capture_count);
  known_labels_ = dataset.labels;
  add_replicator_metadata("BasicWriter", "0.0.2", dataset, files);
  if (dataset.clips.empty()) return;
  files.add_text("clips.json", python_json({{"clips", clips_json(dataset.clips)}}, 1) + "\n");
}

void BasicWriter::write(const Capture& capture, CaptureFiles& files) const {
  const FrameNaming naming{capture.frames.size() > 1, params_.use_common_output_dir,
                           padded(capture.index, frame_padding_)};
  const auto semantic_ids = number_label_sets(known_labels_, capture, filter_, kFirstLabelledId);
  for (const Frame& frame : capture.frames) {
    const FrameOutput output{host_, frame, naming, semantic_ids, filtered_instances(frame, filter_),
                             files};
    write_unlabelled_files(params_, output);
    // A scene without a label that counts has no labelled files at all, not empty ones.
    if (!output.instances.empty()) write_labelled_files(params_, output);
  }
}

}  // namespace diorama
