// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/contours.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "opencv_support/mask_parts.h"
#include "opencv_support/serial_opencv.h"

namespace diorama {
namespace {

using Points = std::vector<cv::Point>;

/// Corners of pixels and middles of their edges as a grid of its own, set where they belong to the
/// part: corner (x, y) of the box is point (2x, 2y). What OpenCV finds as borders on it are those
/// between pixels.
cv::Mat edge_grid(const MaskParts& parts, int number, int width) {
  const PixelBox& box = parts.boxes[std::size_t(number - 1)];
  cv::Mat grid(2 * box.height() + 1, 2 * box.width() + 1, CV_8UC1, cv::Scalar(0));
  for (int y = box.y_min; y < box.y_max; ++y) {
    const std::int32_t* row = parts.part.data() + std::ptrdiff_t(y) * width;
    std::uint8_t* middles = grid.ptr<std::uint8_t>(2 * (y - box.y_min) + 1);
    for (int x = box.x_min; x < box.x_max; ++x) {
      if (row[x] == number) middles[2 * (x - box.x_min) + 1] = 1;
    }
  }
  cv::dilate(grid, grid, cv::Mat::ones(3, 3, CV_8UC1));
  return grid;
}

/// A border on the grid as a polygon of pixel corners; `origin` is the grid's first corner.
/// `is_reversed` turns its direction.
Polygon polygon_of(const Points& border, const Vec2& origin, bool is_reversed) {
  const auto is_corner = [](const cv::Point& p) { return p.x % 2 == 0 && p.y % 2 == 0; };
  Points corners;
  for (std::size_t i = 0; i < border.size(); ++i) {
    const cv::Point& here = border[i];
    const cv::Point& next = border[(i + 1) % border.size()];
    if (is_corner(here)) corners.push_back(here);
    // OpenCV cuts inner corners off.
    if (here.x == next.x || here.y == next.y) continue;
    const cv::Point cut(here.x, next.y);
    corners.push_back(is_corner(cut) ? cut : cv::Point(next.x, here.y));
  }
  Polygon polygon;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Point& before = corners[(i + corners.size() - 1) % corners.size()];
    const cv::Point& after = corners[(i + 1) % corners.size()];
    const bool is_straight = (before.x == corners[i].x && corners[i].x == after.x) ||
                             (before.y == corners[i].y && corners[i].y == after.y);
    if (!is_straight) polygon.push_back(origin + Vec2(corners[i].x / 2, corners[i].y / 2));
  }
  if (is_reversed) std::ranges::reverse(polygon);
  // The first corner in reading order comes first.
  std::ranges::rotate(polygon, std::ranges::min_element(polygon, {}, [](const Vec2& p) {
                        return std::pair(p.y(), p.x());
                      }));
  return polygon;
}

/// Twice; positive for clockwise on the screen.
double signed_area(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2& a = polygon[i];
    const Vec2& b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return twice;
}

Outline outline_of(const MaskParts& parts, int number, int width, const Vec2& box_origin) {
  const PixelBox& box = parts.boxes[std::size_t(number - 1)];
  const Vec2 origin = box_origin + Vec2(box.x_min, box.y_min);
  std::vector<Points> borders;
  std::vector<cv::Vec4i> tree;
  cv::findContours(edge_grid(parts, number, width), borders, tree, cv::RETR_CCOMP,
                   cv::CHAIN_APPROX_NONE);
  Outline outline;
  for (std::size_t i = 0; i < borders.size(); ++i) {
    const bool is_hole = tree[i][3] >= 0;
    // OpenCV walks round parts counter-clockwise on the screen, and clockwise round holes.
    Polygon polygon = polygon_of(borders[i], origin, true);
    if (is_hole) {
      outline.holes.push_back(std::move(polygon));
    } else {
      outline.outer = std::move(polygon);
    }
  }
  std::ranges::sort(outline.holes, {}, [](const Polygon& hole) {
    return std::pair(hole.front().y(), hole.front().x());
  });
  return outline;
}

/// Puts a part into a polygon by a bridge of no width between nearest corners.
void join(const Polygon& part, Polygon& polygon) {
  if (polygon.empty()) {
    polygon = part;
    return;
  }
  std::size_t best_i = 0;
  std::size_t best_j = 0;
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    for (std::size_t j = 0; j < part.size(); ++j) {
      const double distance = (polygon[i] - part[j]).squaredNorm();
      if (distance >= best) continue;
      best = distance;
      best_i = i;
      best_j = j;
    }
  }
  // There, round the part back to where it was entered, and back.
  Polygon detour(part.begin() + std::ptrdiff_t(best_j), part.end());
  detour.insert(detour.end(), part.begin(), part.begin() + std::ptrdiff_t(best_j) + 1);
  detour.push_back(polygon[best_i]);
  polygon.insert(polygon.begin() + std::ptrdiff_t(best_i) + 1, detour.begin(), detour.end());
}

}  // namespace

std::vector<Outline> outlines(const Image<std::uint32_t>& ids, std::uint32_t id,
                              const PixelBox& box) {
  use_serial_opencv();
  std::vector<std::uint8_t> bits;
  bits.reserve(std::size_t(box.width()) * std::size_t(box.height()));
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) bits.push_back(ids.at(x, y) == id ? 1 : 0);
  }
  const MaskParts parts = connected_parts(bits, box.width(), box.height());
  std::vector<Outline> result;
  for (int number = 1; number <= int(parts.boxes.size()); ++number) {
    result.push_back(outline_of(parts, number, box.width(), Vec2(box.x_min, box.y_min)));
  }
  std::ranges::stable_sort(result, std::ranges::greater(),
                           [](const Outline& outline) { return signed_area(outline.outer); });
  return result;
}

Polygon joined(const Outline& part) {
  Polygon result = part.outer;
  for (const Polygon& hole : part.holes) join(hole, result);
  return result;
}

Polygon joined(const std::vector<Outline>& parts) {
  Polygon result;
  for (const Outline& part : parts) join(joined(part), result);
  return result;
}

std::array<Vec2, 4> least_rectangle(const std::vector<Outline>& parts) {
  use_serial_opencv();
  Points points;
  for (const Outline& part : parts) {
    for (const Vec2& corner : part.outer) points.emplace_back(int(corner.x()), int(corner.y()));
  }
  if (points.empty()) return {};
  std::array<cv::Point2f, 4> corners;
  cv::minAreaRect(points).points(corners.data());
  std::array<Vec2, 4> result;
  std::ranges::transform(corners, result.begin(),
                         [](const cv::Point2f& p) { return Vec2(p.x, p.y); });
  // OpenCV's corners go clockwise on the screen; where they begin hangs on the angle.
  const auto first = std::ranges::min_element(
      result, {}, [](const Vec2& p) { return std::round(16.0 * (p.x() + p.y())); });
  std::ranges::rotate(result, first);
  return result;
}

}  // namespace diorama
