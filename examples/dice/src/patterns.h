// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <diorama/geometry.h>
#include <diorama/material.h>
#include <diorama/rng.h>

/// Colours and patterns that dice and tables share.
namespace dice {

/// Display-referred (sRGB), 0..1.
using Color = diorama::Vec3f;

Color mix(const Color& a, const Color& b, double t);
/// 0 below `low`, 1 above `high`, smooth between them.
double smooth_step(double low, double high, double x);
/// `hue` goes round in [0, 1).
Color from_hsv(double hue, double saturation, double value);
/// White, black and grey as often as colours, as plastic is sold.
Color any_color(diorama::Rng& rng);
diorama::Vec3f linear(const Color& color);

/// Smooth noise in [-1, 1] about 0 with features of about 1; sum of `octaves`, each of half the
/// size and height of the one before.
double noise(std::uint64_t seed, const diorama::Vec3& at, int octaves = 1);
/// Distance from `at` to the nearest of one random point per unit cell, and that point's number.
struct NearestPoint {
  double distance = 0.0;
  std::uint64_t number = 0;
};
NearestPoint nearest_point(std::uint64_t seed, const diorama::Vec3& at);

/// 8-bit sRGB, rows from the top; shade(x, y) is asked for every pixel centre.
std::shared_ptr<const diorama::Texture> painted(
    const std::string& name, int width, int height,
    const std::function<Color(double x, double y)>& shade);

}  // namespace dice
