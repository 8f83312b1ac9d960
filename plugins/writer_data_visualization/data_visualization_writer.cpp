// SPDX-License-Identifier: Apache-2.0
#include "writer_data_visualization/data_visualization_writer.h"

#include <array>
#include <charconv>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "opencv_support/canvas.h"
#include "opencv_support/color_maps.h"
#include "writer_support/color_names.h"
#include "writer_support/image_files.h"
#include "writer_support/label_sets.h"
#include "writer_support/replicator.h"
#include "writer_support/segmentation_colors.h"
#include "writer_support/value_place.h"

namespace diorama {
namespace {

using Look = DataVisualizationWriter::Look;

constexpr Rgba8 kGreen{0, 128, 0, 255};
constexpr std::uint8_t kMaskAlpha = 110;

/// Where an object's tag belongs.
struct Drawn {
  PixelBox box;
  Rgba8 color{};
};

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

Rgba8 ink_of(const Look& look) { return look.outline.value_or(look.fill.value_or(kGreen)); }

void draw_box(Image<Rgba8>& canvas, const PixelBox& box, const Look& look) {
  if (look.fill) fill_rectangle(canvas, box, *look.fill);
  if (look.outline) draw_rectangle(canvas, box, look.width, *look.outline);
}

/// "banana"; several labels as "banana, ripe".
std::string tag_of(const FilteredInstance& filtered) {
  std::string text;
  for (const auto& [taxonomy, label] : filtered.labels) text += (text.empty() ? "" : ", ") + label;
  return text;
}

/// Where the 3-D box is seen: the part of the image that its corners take up.
PixelBox shown_box(const Frame& frame, const Instance& instance) {
  const Affine camera_from_node = frame.world_from_camera.inverse() * instance.world_from_node;
  Eigen::AlignedBox2d extent;
  for (int i = 0; i < 8; ++i) {
    const auto pixel = project(frame.camera, camera_from_node * instance.bounds_node.corner(i));
    if (pixel && pixel->allFinite()) extent.extend(*pixel);
  }
  const Vec2 size(frame.camera.width, frame.camera.height);
  if (extent.isEmpty()) return {0, 0, int(size.x()), int(size.y())};
  const Vec2 lo = extent.min().cwiseMax(Vec2::Zero()).cwiseMin(size);
  const Vec2 hi = extent.max().cwiseMax(Vec2::Zero()).cwiseMin(size);
  return {int(lo.x()), int(lo.y()), int(hi.x()), int(hi.y())};
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

/// "0.53 m ... 4.10 m" at the lower left, so that colours say something.
void draw_scale(Image<Rgba8>& canvas, const std::string& text) {
  draw_tag(canvas, {0, canvas.height(), 0, canvas.height()}, text, {40, 40, 40, 255});
}

std::string number_text(double number, const char* unit) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.3g %s", number, unit);
  return text.data();
}

Image<Rgba8> distance_picture_of(const Frame& frame) {
  const auto& distances = frame.get(kDistanceToImagePlane);
  const DistanceRange range = distance_range(distances);
  Image<Rgba8> canvas = distance_colors(distances, range);
  draw_scale(canvas, "red " + number_text(double(range.near), "m") + ", blue " +
                         number_text(double(range.far), "m"));
  return canvas;
}

Image<Rgba8> motion_picture_of(const Frame& frame) {
  const auto& motion = frame.get(kMotion);
  const float longest = motion_range(motion);
  Image<Rgba8> canvas = motion_colors(motion, longest);
  draw_scale(canvas, "full colour " + number_text(double(longest), "px"));
  return canvas;
}

bool is_in_image(const Instance& instance) {
  return instance.visibility && instance.visibility->amodal_pixels > 0;
}

}  // namespace

void DataVisualizationWriter::Params::visit(ParamVisitor& v) {
  v.param("bounding_box_2d_tight", bounding_box_2d_tight, {"Draw boxes of the visible pixels."});
  v.param("bounding_box_2d_loose", bounding_box_2d_loose, {"Draw boxes of whole objects."});
  v.param("bounding_box_3d", bounding_box_3d, {"Draw 3-D boxes."});
  v.param("instance_masks", instance_masks,
          {"Draw the visible pixels of objects, a colour for each."});
  v.param("distance_to_image_plane", distance_to_image_plane,
          {"Draw distances as colours, near red and far blue."});
  v.param("motion", motion, {"Draw motion as colours: direction as hue, speed as saturation."});
  v.param("labels", labels, {"Write labels at boxes and masks."});
  v.param("bounding_box_2d_tight_params", bounding_box_2d_tight_params,
          {"Mapping: background (rgb, normals), fill, outline, width."});
  v.param("bounding_box_2d_loose_params", bounding_box_2d_loose_params,
          {"Mapping: background (rgb, normals), fill, outline, width."});
  v.param("bounding_box_3d_params", bounding_box_3d_params,
          {"Mapping: background (rgb, normals), fill (the colour of the lines), width."});
  v.param("instance_masks_params", instance_masks_params,
          {"Mapping: background (rgb, the default, normals or null), fill (one colour for all; its "
           "alpha counts), width (of outlines)."});
  v.param("frame_padding", frame_padding,
          {"Least digits of the frame number; more where the job needs them.", "", 0, 20});
}

DataVisualizationWriter::DataVisualizationWriter(Params params, Host& host)
    : has_distance_(params.distance_to_image_plane),
      has_motion_(params.motion),
      has_labels_(params.labels),
      host_(host),
      filter_(SemanticFilter::parse("class:*")),
      frame_padding_(params.frame_padding) {
  Look box;
  box.outline = kGreen;
  Look cuboid;
  cuboid.fill = kGreen;
  Look mask;
  mask.background = Look::Background::Rgb;
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
  if (params.instance_masks) {
    masks_ = read_look(params.instance_masks_params, "instance_masks_params", mask, host);
  }
}

NameSet DataVisualizationWriter::needs() const {
  NameSet names{"instances"};
  for (const auto* look : {&tight_, &loose_, &cuboid_, &masks_}) {
    if (!*look) continue;
    if ((*look)->background == Look::Background::Rgb) names.emplace(kColor.name);
    if ((*look)->background == Look::Background::Normals) names.emplace(kNormals.name);
  }
  if (tight_ || masks_) names.emplace(kInstanceId.name);
  if (has_distance_) names.emplace(kDistanceToImagePlane.name);
  if (has_motion_) names.emplace(kMotion.name);
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
    const auto add_file = [&](const char* name, const Image<Rgba8>& canvas) {
      files.add(render_product_name(frame) + "/" + name + ending, png_file(host_, canvas));
    };
    // `draw` says where an object was drawn and in what colour. Tags come last: nothing hides them.
    const auto add = [&](const std::optional<Look>& look, const char* name, auto draw) {
      if (!look) return;
      Image<Rgba8> canvas = make_canvas(frame, look->background);
      std::vector<std::pair<Drawn, std::string>> tags;
      for (const FilteredInstance& filtered : instances) {
        const std::optional<Drawn> drawn = draw(canvas, *filtered.instance);
        if (drawn && has_labels_) tags.emplace_back(*drawn, tag_of(filtered));
      }
      for (const auto& [drawn, text] : tags) draw_tag(canvas, drawn.box, text, drawn.color);
      add_file(name, canvas);
    };
    using MaybeDrawn = std::optional<Drawn>;
    add(tight_, "bounding_box_2d_tight",
        [&](Image<Rgba8>& canvas, const Instance& instance) -> MaybeDrawn {
          if (!instance.tight_box) return std::nullopt;
          draw_box(canvas, *instance.tight_box, *tight_);
          return Drawn{*instance.tight_box, ink_of(*tight_)};
        });
    add(loose_, "bounding_box_2d_loose",
        [&](Image<Rgba8>& canvas, const Instance& instance) -> MaybeDrawn {
          if (!is_in_image(instance)) return std::nullopt;
          draw_box(canvas, *instance.visibility->amodal_box, *loose_);
          return Drawn{*instance.visibility->amodal_box, ink_of(*loose_)};
        });
    add(cuboid_, "bounding_box_3d",
        [&](Image<Rgba8>& canvas, const Instance& instance) -> MaybeDrawn {
          if (!is_in_image(instance)) return std::nullopt;
          draw_cuboid(canvas, frame, instance, *cuboid_);
          return Drawn{shown_box(frame, instance), ink_of(*cuboid_)};
        });
    add(masks_, "instance_masks",
        [&](Image<Rgba8>& canvas, const Instance& instance) -> MaybeDrawn {
          if (!instance.tight_box) return std::nullopt;
          Rgba8 color = segmentation_color(instance.id);
          color[3] = kMaskAlpha;
          if (masks_->fill) color = *masks_->fill;
          fill_mask(canvas, frame.get(kInstanceId), instance.id, *instance.tight_box, masks_->width,
                    color);
          return Drawn{*instance.tight_box, color};
        });
    if (has_distance_) add_file("distance_to_image_plane", distance_picture_of(frame));
    if (has_motion_) add_file("motion", motion_picture_of(frame));
  }
}

}  // namespace diorama
