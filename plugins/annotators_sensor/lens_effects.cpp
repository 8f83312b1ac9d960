// SPDX-License-Identifier: Apache-2.0
#include "lens_effects.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

float falloff(const Camera& camera, const Vec2& pixel, double strength) {
  const auto direction = ray_direction(camera, pixel);
  if (!direction) return 0.0f;
  return float(std::pow(std::max(0.0, -direction->z()), 4.0 * strength));
}

/// One colour at a place in pixel coordinates, between the four pixels around it.
float bilinear(const Image<Vec3f>& image, const Vec2& place, Eigen::Index channel) {
  const double x = std::clamp(place.x() - 0.5, 0.0, image.width() - 1.0);
  const double y = std::clamp(place.y() - 0.5, 0.0, image.height() - 1.0);
  const int x0 = int(x);
  const int y0 = int(y);
  const int x1 = std::min(x0 + 1, image.width() - 1);
  const int y1 = std::min(y0 + 1, image.height() - 1);
  const float u = float(x - x0);
  const float v = float(y - y0);
  const float upper = image.at(x0, y0)[channel] * (1.0f - u) + image.at(x1, y0)[channel] * u;
  const float lower = image.at(x0, y1)[channel] * (1.0f - u) + image.at(x1, y1)[channel] * u;
  return upper * (1.0f - v) + lower * v;
}

}  // namespace

Image<Vec3f> through_lens(const Image<Vec3f>& radiance, const Camera& camera,
                          const LensEffects& effects, Host& host) {
  Image<Vec3f> image = radiance;
  const Vec2 axis(camera.cx, camera.cy);
  const double half_diagonal = 0.5 * std::hypot(camera.width, camera.height);
  const double red_scale = 1.0 / (1.0 + effects.red_shift_px / half_diagonal);
  const double blue_scale = 1.0 / (1.0 + effects.blue_shift_px / half_diagonal);
  host.parallel_for(std::size_t(image.height()), [&](std::size_t y) {
    const auto row = image.row(int(y));
    for (std::size_t x = 0; x < row.size(); ++x) {
      const Vec2 pixel(double(x) + 0.5, double(y) + 0.5);
      if (red_scale != 1.0) row[x].x() = bilinear(radiance, axis + red_scale * (pixel - axis), 0);
      if (blue_scale != 1.0) {
        row[x].z() = bilinear(radiance, axis + blue_scale * (pixel - axis), 2);
      }
      if (effects.vignetting > 0.0) row[x] *= falloff(camera, pixel, effects.vignetting);
    }
  });
  return image;
}

}  // namespace diorama
