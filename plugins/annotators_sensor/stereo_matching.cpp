// SPDX-License-Identifier: Apache-2.0
#include "stereo_matching.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace diorama {
namespace {

/// The nearest surface at every pixel of one row of the second view.
std::vector<float> second_view(std::span<const float> disparity, double edge_step_px) {
  std::vector<float> nearest(disparity.size(), 0.0f);
  const auto put = [&](double from, double to, float value) {
    const int last = std::min(int(nearest.size()) - 1, int(std::floor(to)));
    for (int x = std::max(0, int(std::ceil(from))); x <= last; ++x) {
      nearest[std::size_t(x)] = std::max(nearest[std::size_t(x)], value);
    }
  };
  for (std::size_t x = 0; x < disparity.size(); ++x) {
    if (disparity[x] <= 0.0f) continue;
    const double place = double(x) - double(disparity[x]);
    put(place - 0.5, place + 0.5, disparity[x]);
    // Surfaces that run away from the second view are spread over it without gaps.
    const bool goes_on = x + 1 < disparity.size() && disparity[x + 1] > 0.0f &&
                         std::abs(double(disparity[x + 1] - disparity[x])) <= edge_step_px;
    if (!goes_on) continue;
    put(place, double(x) + 1.0 - double(disparity[x + 1]),
        std::min(disparity[x], disparity[x + 1]));
  }
  return nearest;
}

bool is_edge(float a, float b, double step) {
  if ((a > 0.0f) != (b > 0.0f)) return true;
  return std::abs(double(a) - double(b)) > step;
}

/// Turns every 0 into a square of zeros with the pixel at its centre.
void grow_zeros(PixelMask& mask, int radius) {
  const auto spread = [&](int dx, int dy) {
    const PixelMask before = mask;
    for (int y = 0; y < mask.height(); ++y) {
      for (int x = 0; x < mask.width(); ++x) {
        for (int i = -radius; i <= radius; ++i) {
          const int from_x = x + i * dx;
          const int from_y = y + i * dy;
          if (before.contains(from_x, from_y) && before.at(from_x, from_y) == 0) mask.at(x, y) = 0;
        }
      }
    }
  };
  spread(1, 0);
  spread(0, 1);
}

}  // namespace

PixelMask seen_by_both(const Image<float>& disparity, const StereoMatching& matching) {
  PixelMask mask(disparity.width(), disparity.height(), 0);
  for (int y = 0; y < disparity.height(); ++y) {
    const auto row = disparity.row(y);
    const std::vector<float> nearest = second_view(row, matching.edge_step_px);
    for (std::size_t x = 0; x < row.size(); ++x) {
      const long place = std::lround(double(x) - double(row[x]));
      if (row[x] <= 0.0f || place < 0) continue;
      const float front = nearest[std::size_t(place)];
      mask.at(int(x), y) = double(front) - double(row[x]) <= matching.edge_step_px ? 1 : 0;
    }
  }
  return mask;
}

PixelMask far_from_edges(const Image<float>& disparity, const StereoMatching& matching) {
  PixelMask mask(disparity.width(), disparity.height(), 1);
  const auto compare = [&](int x, int y, int other_x, int other_y) {
    if (!is_edge(disparity.at(x, y), disparity.at(other_x, other_y), matching.edge_step_px)) return;
    mask.at(x, y) = 0;
    mask.at(other_x, other_y) = 0;
  };
  if (matching.edge_radius_px <= 0) return mask;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (x + 1 < mask.width()) compare(x, y, x + 1, y);
      if (y + 1 < mask.height()) compare(x, y, x, y + 1);
    }
  }
  // The pixels beside the edge are one away from it already.
  grow_zeros(mask, matching.edge_radius_px - 1);
  return mask;
}

PixelMask seen_steeply(const Image<float>& depth, const Camera& camera,
                       const StereoMatching& matching) {
  PixelMask mask(depth.width(), depth.height(), 0);
  Image<Vec3> points(depth.width(), depth.height(), Vec3::Zero());
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const auto direction = ray_direction(camera, Vec2(x + 0.5, y + 0.5));
      if (!direction || !(direction->z() < 0.0) || !std::isfinite(depth.at(x, y))) continue;
      points.at(x, y) = *direction * (double(depth.at(x, y)) / -direction->z());
    }
  }
  const double least_cosine = std::cos(matching.max_incidence_rad);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const Vec3& point = points.at(x, y);
      if (point.isZero(0.0)) continue;
      const Vec3& left = points.at(std::max(x - 1, 0), y);
      const Vec3& right = points.at(std::min(x + 1, depth.width() - 1), y);
      const Vec3& above = points.at(x, std::max(y - 1, 0));
      const Vec3& below = points.at(x, std::min(y + 1, depth.height() - 1));
      const Vec3 normal = (right - left).cross(above - below);
      const double scale = normal.norm() * point.norm();
      // A picture one pixel wide tells no directions.
      const bool is_steep = scale == 0.0 || std::abs(normal.dot(point)) >= least_cosine * scale;
      mask.at(x, y) = is_steep ? 1 : 0;
    }
  }
  return mask;
}

}  // namespace diorama
