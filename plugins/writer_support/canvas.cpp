// SPDX-License-Identifier: Apache-2.0
#include "writer_support/canvas.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace diorama {
namespace {

/// The part of a segment inside the picture grown by `margin` (Liang and Barsky 1984).
std::optional<std::pair<Vec2, Vec2>> clipped(const Image<Rgba8>& picture, const Vec2& a,
                                             const Vec2& b, double margin) {
  if (!a.allFinite() || !b.allFinite()) return std::nullopt;
  const Vec2 lo = Vec2::Constant(-margin);
  const Vec2 hi(picture.width() + margin, picture.height() + margin);
  const Vec2 step = b - a;
  double begin = 0.0;
  double end = 1.0;
  for (int axis = 0; axis < 2; ++axis) {
    if (step[axis] == 0.0) {
      if (a[axis] < lo[axis] || a[axis] > hi[axis]) return std::nullopt;
      continue;
    }
    double enter = (lo[axis] - a[axis]) / step[axis];
    double leave = (hi[axis] - a[axis]) / step[axis];
    if (enter > leave) std::swap(enter, leave);
    begin = std::max(begin, enter);
    end = std::min(end, leave);
  }
  if (begin > end) return std::nullopt;
  return std::pair<Vec2, Vec2>(a + begin * step, a + end * step);
}

}  // namespace

void draw_pixel(Image<Rgba8>& picture, int x, int y, const Rgba8& color) {
  if (!picture.contains(x, y)) return;
  Rgba8& pixel = picture.at(x, y);
  if (color[3] == 255) {
    pixel = color;
    return;
  }
  const double above = color[3] / 255.0;
  const double below = pixel[3] / 255.0 * (1.0 - above);
  const double alpha = above + below;
  if (alpha == 0.0) return;
  for (std::size_t c = 0; c < 3; ++c) {
    pixel[c] = std::uint8_t(std::lround((color[c] * above + pixel[c] * below) / alpha));
  }
  pixel[3] = std::uint8_t(std::lround(255.0 * alpha));
}

void draw_line(Image<Rgba8>& picture, const Vec2& a, const Vec2& b, int width, const Rgba8& color) {
  const auto visible = clipped(picture, a, b, width + 1.0);
  if (!visible) return;
  const auto [from, to] = *visible;
  const Vec2 step = to - from;
  // Walk along the longer axis; each step paints a run across it.
  const int along = std::abs(step.x()) >= std::abs(step.y()) ? 0 : 1;
  const int across = 1 - along;
  const double slope = step[along] == 0.0 ? 0.0 : step[across] / step[along];
  const double thickness = width * std::sqrt(1.0 + slope * slope);
  const int first = int(std::floor(std::min(from[along], to[along])));
  const int last = int(std::floor(std::max(from[along], to[along])));
  for (int i = first; i <= last; ++i) {
    const double middle = from[across] + slope * (i + 0.5 - from[along]);
    const int run = width == 1 ? 1 : std::max(1, int(std::lround(thickness)));
    const int begin = int(std::floor(middle - 0.5 * (run - 1)));
    for (int j = begin; j < begin + run; ++j) {
      along == 0 ? draw_pixel(picture, i, j, color) : draw_pixel(picture, j, i, color);
    }
  }
}

void fill_circle(Image<Rgba8>& picture, const Vec2& centre, double radius, const Rgba8& color) {
  if (!centre.allFinite()) return;
  const auto limit = [](double value, int size) {
    return int(std::clamp(std::floor(value), -1.0, double(size)));
  };
  for (int y = limit(centre.y() - radius, picture.height());
       y <= limit(centre.y() + radius, picture.height()); ++y) {
    for (int x = limit(centre.x() - radius, picture.width());
         x <= limit(centre.x() + radius, picture.width()); ++x) {
      const Vec2 pixel(x + 0.5, y + 0.5);
      if ((pixel - centre).norm() <= radius) draw_pixel(picture, x, y, color);
    }
  }
}

void fill_rectangle(Image<Rgba8>& picture, const PixelBox& box, const Rgba8& color) {
  const PixelBox inside = box.clipped(picture.width(), picture.height());
  for (int y = inside.y_min; y < inside.y_max; ++y) {
    for (int x = inside.x_min; x < inside.x_max; ++x) draw_pixel(picture, x, y, color);
  }
}

void draw_rectangle(Image<Rgba8>& picture, const PixelBox& box, int width, const Rgba8& color) {
  if (box.is_empty()) return;
  const int w = std::min({width, (box.width() + 1) / 2, (box.height() + 1) / 2});
  const int inner_top = std::min(box.y_min + w, box.y_max);
  const int inner_bottom = std::max(box.y_max - w, inner_top);
  const int inner_left = std::min(box.x_min + w, box.x_max);
  const int inner_right = std::max(box.x_max - w, inner_left);
  fill_rectangle(picture, {box.x_min, box.y_min, box.x_max, inner_top}, color);
  fill_rectangle(picture, {box.x_min, inner_bottom, box.x_max, box.y_max}, color);
  fill_rectangle(picture, {box.x_min, inner_top, inner_left, inner_bottom}, color);
  fill_rectangle(picture, {inner_right, inner_top, box.x_max, inner_bottom}, color);
}

void draw_world_line(Image<Rgba8>& picture, const Frame& frame, const Vec3& a_world,
                     const Vec3& b_world, int width, const Rgba8& color) {
  const Affine camera_from_world = frame.world_from_camera.inverse();
  Vec3 a = camera_from_world * a_world;
  Vec3 b = camera_from_world * b_world;
  const Camera& camera = frame.camera;
  if (camera.lens != LensModel::FisheyePolynomial) {
    const double near = std::max(camera.near_m, 1e-6);
    if (-a.z() < near && -b.z() < near) return;
    if (-a.z() < near) a = b + (a - b) * ((-near - b.z()) / (a.z() - b.z()));
    if (-b.z() < near) b = a + (b - a) * ((-near - a.z()) / (b.z() - a.z()));
  }
  const int pieces = camera.lens == LensModel::Pinhole ? 1 : 32;
  std::optional<Vec2> last = project(camera, a);
  for (int i = 1; i <= pieces; ++i) {
    const std::optional<Vec2> next = project(camera, a + (b - a) * (double(i) / pieces));
    if (last && next) draw_line(picture, *last, *next, width, color);
    last = next;
  }
}

}  // namespace diorama
