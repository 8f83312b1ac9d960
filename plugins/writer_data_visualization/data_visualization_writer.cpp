// SPDX-License-Identifier: Apache-2.0
#include "writer_data_visualization/data_visualization_writer.h"

#include <array>
#include <charconv>
#include <utility>

#include "writer_support/canvas.h"
#include "writer_support/color_names.h"
#include "writer_support/image_files.h"
#include "writer_support/label_sets.h"
#include "writer_support/replicator.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

using Look = DataVisualizationWriter::Look;

constexpr Rgba8 kGreen{0, 128, 0, 255};

int read_width(const Value& value, const std::string& key) {
  int width = 0;
  const char* end = value.scalar.data() + value.scalar.size();
  const auto result = std::from_chars(value.scalar.data(), end, width);
  if (result.ec == std::errc() && result.ptr == end && width >= 0 && width <= 1000) return width;
  throw Error(ErrorKind::Config, complaint_about(value, key) +
                                     "expected an integer in [0, 1000], found " + value.describe());
}

Look::Background read_background(const Value& value, const std::string& key) {
  if (value.kind == Value::Kind::Null) return Look::Background::None;
  if (value.scalar == "rgb") return Look::Background::Rgb;
  if (value.scalar == "normals") return Look::Background::Normals;
  throw Error(ErrorKind::Config, complaint_about(value, key) +
                                     "expected rgb, normals or null, found " + value.describe());
}

/// `look` holds the defaults.
Look read_look(const Value& params, const std::string& name, Look look, Host& host) {
  if (params.kind == Value::Kind::Null) return look;
  if (params.kind != Value::Kind::Map) {
    throw Error(ErrorKind::Config,
                complaint_about(params, name) + "expected a mapping, found " + params.describe());
  }
  for (const auto& [key, value] : params.map) {
    const std::string full_key = name + "." + key;
    if (key == "background") {
      look.background = read_background(value, full_key);
    } else if (key == "fill") {
      look.fill = color_from_value(value, full_key);
    } else if (key == "outline") {
      look.outline = color_from_value(value, full_key);
    } else if (key == "width") {
      look.width = read_width(value, full_key);
    } else {
      host.log(LogLevel::Warning, value.key_place.text() + ": " + full_key +
                                      " has no effect; known are background, fill, outline, width");
    }
  }
  return look;
}

Image<Rgba8> make_canvas(const Frame& frame, Look::Background background) {
  switch (background) {
    case Look::Background::Rgb:
      return frame.get(kColor);
    case Look::Background::Normals:
      return normals_picture(frame.get(kNormals));
    case Look::Background::None:
      break;
  }
  return {frame.camera.width, frame.camera.height, Rgba8{}};
}

void draw_box(Image<Rgba8>& canvas, const PixelBox& box, const Look& look) {
  if (look.fill) fill_rectangle(canvas, box, *look.fill);
  if (look.outline) draw_rectangle(canvas, box, look.width, *look.outline);
}

void draw_cuboid(Image<Rgba8>& canvas, const Frame& frame, const Instance& instance,
                 const Look& look) {
  if (!look.fill || look.width == 0) return;
  // Each corner is joined to those that differ from it in one axis.
  for (int i = 0; i < 8; ++i) {
    for (const int bit : {1, 2, 4}) {
      if ((i & bit) != 0) continue;
      draw_world_line(canvas, frame, instance.world_from_node * instance.bounds_node.corner(i),
                      instance.world_from_node * instance.bounds_node.corner(i | bit), look.width,
                      *look.fill);
    }
  }
}

bool is_in_image(const Instance& instance) {
  return instance.visibility && instance.visibility->amodal_pixels > 0;
}

}  // namespace

void DataVisualizationWriter::Params::visit(ParamVisitor& v) {
  v.param("bounding_box_2d_tight", bounding_box_2d_tight, {"Draw boxes of the visible pixels."});
  v.param("bounding_box_2d_loose", bounding_box_2d_loose, {"Draw boxes of whole objects."});
  v.param("bounding_box_3d", bounding_box_3d, {"Draw 3-D boxes."});
  v.param("bounding_box_2d_tight_params", bounding_box_2d_tight_params,
          {"Mapping: background (rgb, normals), fill, outline, width."});
  v.param("bounding_box_2d_loose_params", bounding_box_2d_loose_params,
          {"Mapping: background (rgb, normals), fill, outline, width."});
  v.param("bounding_box_3d_params", bounding_box_3d_params,
          {"Mapping: background (rgb, normals), fill (the colour of the lines), width."});
  v.param("frame_padding", frame_padding,
          {"Least digits of the frame number; more where the job needs them.", "", 0, 20});
}

DataVisualizationWriter::DataVisualizationWriter(Params params, Host& host)
    : host_(host), filter_(SemanticFilter::parse("class:*")), frame_padding_(params.frame_padding) {
  Look box;
  box.outline = kGreen;
  Look cuboid;
  cuboid.fill = kGreen;
  if (params.bounding_box_2d_tight) {
    tight_ =
        read_look(params.bounding_box_2d_tight_params, "bounding_box_2d_tight_params", box, host);
  }
  if (params.bounding_box_2d_loose) {
    loose_ =
        read_look(params.bounding_box_2d_loose_params, "bounding_box_2d_loose_params", box, host);
  }
  if (params.bounding_box_3d) {
    cuboid_ = read_look(params.bounding_box_3d_params, "bounding_box_3d_params", cuboid, host);
  }
}

NameSet DataVisualizationWriter::needs() const {
  NameSet names{"instances"};
  for (const auto* look : {&tight_, &loose_, &cuboid_}) {
    if (!*look) continue;
    if ((*look)->background == Look::Background::Rgb) names.emplace(kColor.name);
    if ((*look)->background == Look::Background::Normals) names.emplace(kNormals.name);
  }
  if (tight_) names.emplace(kInstanceId.name);
  if (loose_ || cuboid_) names.insert({std::string(kInstanceId.name), "visibility"});
  return names;
}

void DataVisualizationWriter::begin(const DatasetInfo& dataset, DatasetFiles& files) {
  frame_padding_ = grown_padding(frame_padding_, dataset.capture_count);
  add_replicator_metadata("DataVisualizationWriter", "0.1.0", dataset, files);
}

void DataVisualizationWriter::write(const Capture& capture, CaptureFiles& files) const {
  const std::string ending = "_fast_" + padded(capture.index, frame_padding_) + ".png";
  for (const Frame& frame : capture.frames) {
    const auto instances = filtered_instances(frame, filter_);
    if (instances.empty()) continue;
    const auto add = [&](const std::optional<Look>& look, const char* name, auto draw) {
      if (!look) return;
      Image<Rgba8> canvas = make_canvas(frame, look->background);
      for (const FilteredInstance& filtered : instances) draw(canvas, *filtered.instance);
      files.add(render_product_name(frame) + "/" + name + ending, png_file(host_, canvas));
    };
    add(tight_, "bounding_box_2d_tight", [&](Image<Rgba8>& canvas, const Instance& instance) {
      if (instance.tight_box) draw_box(canvas, *instance.tight_box, *tight_);
    });
    add(loose_, "bounding_box_2d_loose", [&](Image<Rgba8>& canvas, const Instance& instance) {
      if (is_in_image(instance)) draw_box(canvas, *instance.visibility->amodal_box, *loose_);
    });
    add(cuboid_, "bounding_box_3d", [&](Image<Rgba8>& canvas, const Instance& instance) {
      if (is_in_image(instance)) draw_cuboid(canvas, frame, instance, *cuboid_);
    });
  }
}

}  // namespace diorama
