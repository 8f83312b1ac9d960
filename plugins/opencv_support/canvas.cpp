// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "opencv_support/serial_opencv.h"

namespace diorama {
namespace {

constexpr int kShift = 8;  ///< Fixed point of OpenCV's drawing.
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

double fixed(double pixels) { return std::round(std::ldexp(pixels, kShift)); }

/// How much of each pixel something covers, drawn by OpenCV, in a part of a picture.
class Coverage {
 public:
  Coverage(const Image<Rgba8>& picture, const PixelBox& part)
      : part_(part.clipped(picture.width(), picture.height())) {
    use_serial_opencv();
    if (part_.is_empty()) return;
    mask_ = cv::Mat(part_.height(), part_.width(), CV_8UC1, cv::Scalar(0));
  }

  bool is_empty() const { return part_.is_empty(); }
  cv::Mat& mask() { return mask_; }

  /// Of a position of the picture: pixel centres are whole numbers here.
  cv::Point point(const Vec2& p) const {
    return {int(fixed(p.x() - 0.5 - part_.x_min)), int(fixed(p.y() - 0.5 - part_.y_min))};
  }

  void ink(Image<Rgba8>& picture, const Rgba8& color) const {
    for (int y = part_.y_min; y < part_.y_max; ++y) {
      const std::uint8_t* covered = mask_.ptr<std::uint8_t>(y - part_.y_min);
      const auto row = picture.row(y).subspan(std::size_t(part_.x_min));
      for (int x = 0; x < part_.width(); ++x) {
        if (covered[x] != 0) blend(row[std::size_t(x)], color, covered[x] * color[3] / 255.0);
      }
    }
  }

 private:
  /// `share` is the ink's alpha in [0, 255].
  static void blend(Rgba8& pixel, const Rgba8& color, double share) {
    const double above = share / 255.0;
    const double below = pixel[3] / 255.0 * (1.0 - above);
    const double alpha = above + below;
    if (alpha == 0.0) return;
    for (std::size_t c = 0; c < 3; ++c) {
      pixel[c] = std::uint8_t(std::lround((color[c] * above + pixel[c] * below) / alpha));
    }
    pixel[3] = std::uint8_t(std::lround(255.0 * alpha));
  }

  PixelBox part_;
  cv::Mat mask_;
};

/// The part of a segment inside the picture grown by `margin` pixels.
std::optional<std::pair<Vec2, Vec2>> clipped(const Image<Rgba8>& picture, const Vec2& a,
                                             const Vec2& b, double margin) {
  constexpr double kFarthest = 1e12;
  if (!(a.cwiseAbs().maxCoeff() < kFarthest) || !(b.cwiseAbs().maxCoeff() < kFarthest)) {
    return std::nullopt;
  }
  const auto whole = [](double pixels) { return std::int64_t(fixed(pixels)); };
  const auto grid = [&](const Vec2& p) {
    return cv::Point2l(whole(p.x() + margin), whole(p.y() + margin));
  };
  cv::Point2l from = grid(a);
  cv::Point2l to = grid(b);
  const cv::Size2l size(whole(picture.width() + 2.0 * margin),
                        whole(picture.height() + 2.0 * margin));
  if (!cv::clipLine(size, from, to)) return std::nullopt;
  const auto back = [&](const cv::Point2l& p) {
    return Vec2(std::ldexp(double(p.x), -kShift) - margin,
                std::ldexp(double(p.y), -kShift) - margin);
  };
  return std::pair(back(from), back(to));
}

/// What smooth edges of OpenCV's filled shapes add to each side, in pixels.
constexpr double kEdge = 0.65;

void draw_stroke(Coverage& coverage, const Vec2& a, const Vec2& b, int width) {
  // OpenCV's thick smooth lines are two pixels thicker than asked for.
  if (width == 1 || a == b) {
    cv::line(coverage.mask(), coverage.point(a), coverage.point(b), cv::Scalar(255), 1, cv::LINE_AA,
             kShift);
    return;
  }
  const Vec2 along = (b - a).normalized() * (0.5 * width - kEdge);
  const Vec2 across(-along.y(), along.x());
  const std::array<cv::Point, 4> corners{
      coverage.point(a - along - across), coverage.point(b + along - across),
      coverage.point(b + along + across), coverage.point(a - along + across)};
  cv::fillConvexPoly(coverage.mask(), corners.data(), int(corners.size()), cv::Scalar(255),
                     cv::LINE_AA, kShift);
}

/// Lines that meet are inked as one.
void draw_lines(Image<Rgba8>& picture, const std::vector<std::pair<Vec2, Vec2>>& lines, int width,
                const Rgba8& color) {
  if (width <= 0) return;
  std::vector<std::pair<Vec2, Vec2>> visible;
  Eigen::AlignedBox2d extent;
  for (const auto& [a, b] : lines) {
    const auto line = clipped(picture, a, b, width + 2.0);
    if (!line) continue;
    visible.push_back(*line);
    extent.extend(line->first).extend(line->second);
  }
  if (visible.empty()) return;
  const int margin = width / 2 + 3;
  Coverage coverage(
      picture,
      {int(std::floor(extent.min().x())) - margin, int(std::floor(extent.min().y())) - margin,
       int(std::ceil(extent.max().x())) + margin, int(std::ceil(extent.max().y())) + margin});
  if (coverage.is_empty()) return;
  for (const auto& [a, b] : visible) draw_stroke(coverage, a, b, width);
  coverage.ink(picture, color);
}

bool is_bright(const Rgba8& color) {
  return 0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2] > 140.0;
}

}  // namespace

void draw_line(Image<Rgba8>& picture, const Vec2& a, const Vec2& b, int width, const Rgba8& color) {
  draw_lines(picture, {{a, b}}, width, color);
}

void fill_circle(Image<Rgba8>& picture, const Vec2& centre, double radius, const Rgba8& color) {
  const double reach = radius + 2.0;
  const bool is_near = centre.x() > -reach && centre.x() < picture.width() + reach &&
                       centre.y() > -reach && centre.y() < picture.height() + reach;
  if (!is_near || !(radius > 0.0)) return;
  Coverage coverage(picture,
                    {int(std::floor(centre.x() - reach)), int(std::floor(centre.y() - reach)),
                     int(std::ceil(centre.x() + reach)), int(std::ceil(centre.y() + reach))});
  if (coverage.is_empty()) return;
  cv::circle(coverage.mask(), coverage.point(centre), int(fixed(std::max(0.5, radius - kEdge))),
             cv::Scalar(255), cv::FILLED, cv::LINE_AA, kShift);
  coverage.ink(picture, color);
}

void fill_rectangle(Image<Rgba8>& picture, const PixelBox& box, const Rgba8& color) {
  Coverage coverage(picture, box);
  if (coverage.is_empty()) return;
  coverage.mask().setTo(255);
  coverage.ink(picture, color);
}

void draw_rectangle(Image<Rgba8>& picture, const PixelBox& box, int width, const Rgba8& color) {
  Coverage coverage(picture, box);
  if (coverage.is_empty() || width <= 0) return;
  coverage.mask().setTo(255);
  const PixelBox part = box.clipped(picture.width(), picture.height());
  const PixelBox inner{box.x_min + width, box.y_min + width, box.x_max - width, box.y_max - width};
  const PixelBox hole = inner.clipped(picture.width(), picture.height());
  if (!inner.is_empty() && !hole.is_empty()) {
    const cv::Rect rows(hole.x_min - part.x_min, hole.y_min - part.y_min, hole.width(),
                        hole.height());
    coverage.mask()(rows).setTo(0);
  }
  coverage.ink(picture, color);
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
  std::vector<std::pair<Vec2, Vec2>> lines;
  for (int i = 1; i <= pieces; ++i) {
    const std::optional<Vec2> next = project(camera, a + (b - a) * (double(i) / pieces));
    if (last && next) lines.emplace_back(*last, *next);
    last = next;
  }
  draw_lines(picture, lines, width, color);
}

void fill_mask(Image<Rgba8>& picture, const Image<std::uint32_t>& ids, std::uint32_t id,
               const PixelBox& box, int width, const Rgba8& color) {
  const int margin = width + 2;
  const PixelBox part{box.x_min - margin, box.y_min - margin, box.x_max + margin,
                      box.y_max + margin};
  Coverage inside(picture, part);
  if (inside.is_empty()) return;
  const PixelBox shown = part.clipped(picture.width(), picture.height());
  for (int y = shown.y_min; y < shown.y_max; ++y) {
    std::uint8_t* row = inside.mask().ptr<std::uint8_t>(y - shown.y_min);
    for (int x = shown.x_min; x < shown.x_max; ++x) {
      row[x - shown.x_min] = ids.at(x, y) == id ? 255 : 0;
    }
  }
  inside.ink(picture, color);
  if (width <= 0) return;
  Coverage border(picture, part);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(inside.mask(), contours, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  cv::drawContours(border.mask(), contours, -1, cv::Scalar(255), std::max(1, width - 1),
                   cv::LINE_AA);
  border.ink(picture, {color[0], color[1], color[2], 255});
}

int text_height(const Image<Rgba8>& picture) {
  return std::clamp(std::min(picture.width(), picture.height()) / 45, 8, 60);
}

void draw_tag(Image<Rgba8>& picture, const PixelBox& box, const std::string& text,
              const Rgba8& color) {
  if (text.empty()) return;
  use_serial_opencv();
  const int height = text_height(picture);
  const int thickness = std::max(1, height / 10);
  const double scale = cv::getFontScaleFromHeight(kFont, height, thickness);
  int below = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale, thickness, &below);
  const int pad = std::max(2, height / 4);
  const int plate_width = size.width + 2 * pad;
  const int plate_height = size.height + below + 2 * pad;
  const int x = std::clamp(box.x_min, 0, std::max(0, picture.width() - plate_width));
  int y = box.y_min - plate_height;
  if (y < 0) y = box.y_max;
  if (y + plate_height > picture.height()) y = std::max(0, box.y_min);
  y = std::clamp(y, 0, std::max(0, picture.height() - plate_height));
  const PixelBox plate{x, y, x + plate_width, y + plate_height};
  fill_rectangle(picture, plate, {color[0], color[1], color[2], 255});
  Coverage letters(picture, plate);
  if (letters.is_empty()) return;
  cv::putText(letters.mask(), text, {pad, pad + size.height}, kFont, scale, cv::Scalar(255),
              thickness, cv::LINE_AA);
  const std::uint8_t shade = is_bright(color) ? 0 : 255;
  letters.ink(picture, {shade, shade, shade, 255});
}

}  // namespace diorama
