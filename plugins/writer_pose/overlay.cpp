// SPDX-License-Identifier: Apache-2.0
#include "writer_pose/overlay.h"

#include <algorithm>

#include "opencv_support/canvas.h"

namespace diorama {
namespace {

constexpr Rgba8 kRed{255, 0, 0, 255};
constexpr Rgba8 kGreen{0, 128, 0, 255};
constexpr Rgba8 kBlue{0, 0, 255, 255};
constexpr std::array<Rgba8, 3> kAxisColors{kRed, kGreen, kBlue};
constexpr std::array<Rgba8, kKeypointCount> kPointColors{{{255, 255, 255, 255},
                                                          kRed,
                                                          kGreen,
                                                          kBlue,
                                                          {255, 255, 0, 255},
                                                          {0, 255, 255, 255},
                                                          {255, 0, 255, 255},
                                                          {255, 165, 0, 255},
                                                          {128, 0, 128, 255}}};

/// The colour of the edge between two keypoints; transparent when they share no edge.
Rgba8 edge_color(const CuboidPoint& a, const CuboidPoint& b) {
  int differences = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (a.side[axis] == 0 || b.side[axis] == 0) return {};
    if (a.side[axis] != b.side[axis]) ++differences;
  }
  if (differences != 1) return {};
  if (a.side[2] != b.side[2]) return kGreen;
  return a.side[2] > 0 ? kRed : kBlue;
}

void draw_cuboid(Image<Rgba8>& picture, const Frame& frame, const ObjectPose& object,
                 PoseLayout layout) {
  const auto& order = keypoint_order(layout);
  for (std::size_t a = 0; a < order.size(); ++a) {
    for (std::size_t b = a + 1; b < order.size(); ++b) {
      const Rgba8 color = edge_color(order[a], order[b]);
      if (color[3] == 0) continue;
      draw_world_line(picture, frame, object.world_points[a], object.world_points[b], 2, color);
    }
  }
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (object.camera_points[i].z() >= 0.0) continue;
    fill_circle(picture, object.pixels[i], 4.0, kPointColors[i]);
  }
}

void draw_local_axes(Image<Rgba8>& picture, const Frame& frame, const ObjectPose& object,
                     PoseLayout layout) {
  const auto& order = keypoint_order(layout);
  const auto centre = std::ranges::find_if(
      order, [](const CuboidPoint& keypoint) { return keypoint.side == std::array<int, 3>{}; });
  const Vec3 origin = object.world_points[std::size_t(centre - order.begin())];
  const double length = 0.25 * object.size.mean();
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 direction = object.world_from_local.row(axis).head<3>().transpose().normalized();
    draw_world_line(picture, frame, origin, origin + length * direction, 2,
                    kAxisColors[std::size_t(axis)]);
  }
}

/// Yellow where they are seen, grey where something hides them, with a black rim.
void draw_named_points(Image<Rgba8>& picture, const ObjectPose& object) {
  constexpr Rgba8 kRim{0, 0, 0, 255};
  constexpr Rgba8 kSeen{255, 230, 0, 255};
  constexpr Rgba8 kHidden{128, 128, 128, 255};
  for (const ObjectPose::Named& point : object.named) {
    if (point.image.state == ImagePoint::State::Outside) continue;
    const bool is_seen = point.image.state == ImagePoint::State::Visible;
    fill_circle(picture, point.image.pixel, 5.0, kRim);
    fill_circle(picture, point.image.pixel, 3.5, is_seen ? kSeen : kHidden);
  }
}

/// As they look one metre ahead of the camera, moved to the corner.
void draw_world_axes(Image<Rgba8>& picture, const Frame& frame) {
  constexpr double kLength = 0.03;
  const Affine camera_from_world = frame.world_from_camera.inverse();
  const Vec3 origin(0.0, 0.0, -1.0);
  std::array<Vec2, 4> pixels;
  for (int i = 0; i < 4; ++i) {
    Vec3 point = origin;
    if (i < 3) point += kLength * camera_from_world.linear().col(i);
    const std::optional<Vec2> pixel = project(frame.camera, point);
    if (!pixel) return;
    pixels[std::size_t(i)] = *pixel;
  }
  Vec2 lo = pixels[3];
  Vec2 hi = pixels[3];
  for (const Vec2& pixel : pixels) {
    lo = lo.cwiseMin(pixel);
    hi = hi.cwiseMax(pixel);
  }
  const double margin = 0.03 * std::min(picture.width(), picture.height());
  const Vec2 shift(margin - lo.x(), picture.height() - margin - hi.y());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    draw_line(picture, pixels[3] + shift, pixels[axis] + shift, 2, kAxisColors[axis]);
  }
}

}  // namespace

Image<Rgba8> draw_overlay(const Frame& frame, const std::vector<ObjectPose>& objects,
                          PoseLayout layout) {
  Image<Rgba8> picture = frame.get(kColor);
  for (const ObjectPose& object : objects) {
    draw_cuboid(picture, frame, object, layout);
    draw_local_axes(picture, frame, object, layout);
  }
  for (const ObjectPose& object : objects) draw_named_points(picture, object);
  draw_world_axes(picture, frame);
  return picture;
}

}  // namespace diorama
