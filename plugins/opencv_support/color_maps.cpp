// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/color_maps.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "opencv_support/serial_opencv.h"

namespace diorama {
namespace {

float percentile(std::vector<float>& values, double share) {
  const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// The colours of a map for numbers 0 ... 255.
std::vector<Rgba8> palette(cv::ColormapTypes map) {
  use_serial_opencv();
  cv::Mat numbers(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) numbers.at<std::uint8_t>(i) = std::uint8_t(i);
  cv::Mat colors;
  cv::applyColorMap(numbers, colors, map);
  std::vector<Rgba8> result;
  for (int i = 0; i < 256; ++i) {
    const auto& bgr = colors.at<cv::Vec3b>(i);
    result.push_back({bgr[2], bgr[1], bgr[0], 255});
  }
  return result;
}

std::uint8_t byte(double share) {
  return std::uint8_t(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
}

bool is_distance(float d) { return d > 0.0f && std::isfinite(d); }

}  // namespace

DistanceRange distance_range(const Image<float>& distances) {
  std::vector<float> known;
  std::ranges::copy_if(distances.pixels(), std::back_inserter(known), &is_distance);
  if (known.empty()) return {};
  return {percentile(known, 0.01), percentile(known, 0.99)};
}

Image<Rgba8> distance_colors(const Image<float>& distances, const DistanceRange& range) {
  static const std::vector<Rgba8> kTurbo = palette(cv::COLORMAP_TURBO);
  Image<Rgba8> picture(distances.width(), distances.height(), Rgba8{});
  const double ratio = std::log(double(range.far) / double(range.near));
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    const float d = distances.pixels()[i];
    if (!is_distance(d)) continue;
    const double share = ratio > 0.0 ? std::log(double(d) / double(range.near)) / ratio : 0.5;
    picture.pixels()[i] = kTurbo[byte(1.0 - share)];
  }
  return picture;
}

float motion_range(const Image<Vec2f>& motion) {
  std::vector<float> lengths;
  for (const Vec2f& v : motion.pixels()) {
    const float length = v.norm();
    if (length > 0.0f && std::isfinite(length)) lengths.push_back(length);
  }
  return lengths.empty() ? 0.0f : percentile(lengths, 0.99);
}

Image<Rgba8> motion_colors(const Image<Vec2f>& motion, float longest) {
  static const std::vector<Rgba8> kHues = palette(cv::COLORMAP_HSV);
  Image<Rgba8> picture(motion.width(), motion.height(), Rgba8{255, 255, 255, 255});
  if (!(longest > 0.0f)) return picture;
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    const Vec2f& v = motion.pixels()[i];
    if (!v.allFinite()) continue;
    const double turn = std::atan2(double(v.y()), double(v.x())) / (2.0 * std::numbers::pi);
    const Rgba8& hue = kHues[byte(turn < 0.0 ? turn + 1.0 : turn)];
    const double length = std::min(1.0, double(v.norm()) / double(longest));
    for (std::size_t c = 0; c < 3; ++c) {
      picture.pixels()[i][c] = byte(1.0 - length * (1.0 - hue[c] / 255.0));
    }
  }
  return picture;
}

}  // namespace diorama
