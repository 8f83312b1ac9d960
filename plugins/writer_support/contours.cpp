// SPDX-License-Identifier: Apache-2.0
#include "writer_support/contours.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace diorama {
namespace {

/// The parts of a mask, numbered from 1.
class Parts {
 public:
  Parts(const Image<std::uint32_t>& ids, std::uint32_t id, const PixelBox& box)
      : box_(box), part_(std::size_t(box.width()) * std::size_t(box.height()), 0) {
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        if (ids.at(x, y) != id || at(x, y) != 0) continue;
        fill(ids, id, x, y, ++count_);
      }
    }
  }

  int at(int x, int y) const {
    if (x < box_.x_min || y < box_.y_min || x >= box_.x_max || y >= box_.y_max) return 0;
    return part_[offset(x, y)];
  }
  int count() const { return count_; }
  const PixelBox& box() const { return box_; }

 private:
  std::size_t offset(int x, int y) const {
    return std::size_t(y - box_.y_min) * std::size_t(box_.width()) + std::size_t(x - box_.x_min);
  }

  void fill(const Image<std::uint32_t>& ids, std::uint32_t id, int x, int y, int number) {
    std::vector<Eigen::Vector2i> open{{x, y}};
    part_[offset(x, y)] = number;
    while (!open.empty()) {
      const Eigen::Vector2i pixel = open.back();
      open.pop_back();
      for (const Eigen::Vector2i& step : {Eigen::Vector2i(1, 0), Eigen::Vector2i(-1, 0),
                                          Eigen::Vector2i(0, 1), Eigen::Vector2i(0, -1)}) {
        const Eigen::Vector2i next = pixel + step;
        if (next.x() < box_.x_min || next.y() < box_.y_min || next.x() >= box_.x_max ||
            next.y() >= box_.y_max || ids.at(next.x(), next.y()) != id ||
            at(next.x(), next.y()) != 0) {
          continue;
        }
        part_[offset(next.x(), next.y())] = number;
        open.push_back(next);
      }
    }
  }

  PixelBox box_;
  std::vector<int> part_;
  int count_ = 0;
};

/// Walks along borders with pixels of one part on the right hand.
class BorderWalk {
 public:
  explicit BorderWalk(const Parts& parts)
      : parts_(parts),
        is_walked_(std::size_t(parts.box().width()) * std::size_t(parts.box().height()), false) {}

  /// True for a pixel whose upper side no walk has gone along. Every border has such a side.
  bool begins_at(int x, int y) const {
    const int number = parts_.at(x, y);
    return number != 0 && parts_.at(x, y - 1) != number && !is_walked_[offset(x, y)];
  }

  /// From the upper side of a pixel once round, marking all upper sides.
  Polygon walk(int x, int y) {
    // East, south, west, north; the pixel ahead on the right of a corner, and on the left.
    static const std::array<Eigen::Vector2i, 4> kStep{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
    static const std::array<Eigen::Vector2i, 4> kRight{{{0, 0}, {-1, 0}, {-1, -1}, {0, -1}}};
    static const std::array<Eigen::Vector2i, 4> kLeft{{{0, -1}, {0, 0}, {-1, 0}, {-1, -1}}};
    const int number = parts_.at(x, y);
    const auto holds = [&](const Eigen::Vector2i& pixel) {
      return parts_.at(pixel.x(), pixel.y()) == number;
    };
    const Eigen::Vector2i start(x, y);
    Polygon polygon;
    Eigen::Vector2i corner = start;
    std::size_t heading = 0;
    do {
      if (heading == 0) is_walked_[offset(corner.x(), corner.y())] = true;
      corner += kStep[heading];
      const std::size_t before = heading;
      if (!holds(corner + kRight[heading])) {
        heading = (heading + 1) % 4;
      } else if (holds(corner + kLeft[heading])) {
        heading = (heading + 3) % 4;
      }
      if (heading != before) polygon.push_back(corner.cast<double>());
    } while (corner != start || heading != 0);
    // Where the walk began at a corner, that comes first.
    if (polygon.back() == start.cast<double>()) {
      std::ranges::rotate(polygon, polygon.end() - 1);
    }
    return polygon;
  }

 private:
  std::size_t offset(int x, int y) const {
    const PixelBox& box = parts_.box();
    return std::size_t(y - box.y_min) * std::size_t(box.width()) + std::size_t(x - box.x_min);
  }

  const Parts& parts_;
  std::vector<bool> is_walked_;
};

double area_of(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2& a = polygon[i];
    const Vec2& b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return std::abs(0.5 * twice);
}

double cross(const Vec2& o, const Vec2& a, const Vec2& b) {
  return (a.x() - o.x()) * (b.y() - o.y()) - (a.y() - o.y()) * (b.x() - o.x());
}

/// Andrew's monotone chain.
Polygon convex_hull(std::vector<Vec2> points) {
  std::ranges::sort(points, [](const Vec2& a, const Vec2& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  Polygon hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = hull.size();
    for (const Vec2& point : points) {
      while (hull.size() >= base + 2 && cross(hull[hull.size() - 2], hull.back(), point) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    hull.pop_back();
    std::ranges::reverse(points);
  }
  return hull;
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
  const Parts parts(ids, id, box);
  BorderWalk border(parts);
  std::vector<Outline> result(std::size_t(parts.count()));
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      if (!border.begins_at(x, y)) continue;
      // In reading order a part's outer border comes before those of its holes.
      Outline& outline = result[std::size_t(parts.at(x, y) - 1)];
      if (outline.outer.empty()) {
        outline.outer = border.walk(x, y);
      } else {
        outline.holes.push_back(border.walk(x, y));
      }
    }
  }
  std::ranges::stable_sort(result, std::ranges::greater(),
                           [](const Outline& outline) { return area_of(outline.outer); });
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
  std::vector<Vec2> points;
  for (const Outline& part : parts) {
    points.insert(points.end(), part.outer.begin(), part.outer.end());
  }
  const Polygon hull = convex_hull(std::move(points));
  std::array<Vec2, 4> best{};
  double best_area = std::numeric_limits<double>::infinity();
  // One side of the least rectangle lies along an edge of the hull (Freeman and Shapira 1975).
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2 u = (hull[(i + 1) % hull.size()] - hull[i]).normalized();
    const Vec2 v(-u.y(), u.x());
    Vec2 lo(u.dot(hull[i]), v.dot(hull[i]));
    Vec2 hi = lo;
    for (const Vec2& point : hull) {
      const Vec2 local(u.dot(point), v.dot(point));
      lo = lo.cwiseMin(local);
      hi = hi.cwiseMax(local);
    }
    const double area = (hi - lo).prod();
    if (area >= best_area - 1e-9) continue;
    best_area = area;
    best = {lo.x() * u + lo.y() * v, hi.x() * u + lo.y() * v, hi.x() * u + hi.y() * v,
            lo.x() * u + hi.y() * v};
  }
  return best;
}

}  // namespace diorama
