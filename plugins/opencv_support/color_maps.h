// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/image.h"

/// Pictures of numbers, for people to look at.
namespace diorama {

struct DistanceRange {
  float near = 0.0f;
  float far = 0.0f;
};

/// The 1st and 99th percentile of what is finite and above 0, so that single pixels do not take all
/// colours; nothing is 0 to 0.
DistanceRange distance_range(const Image<float>& distances);

/// Turbo, near red and far blue in steps of equal ratio; black and transparent where nothing is.
Image<Rgba8> distance_colors(const Image<float>& distances, const DistanceRange& range);

/// The 99th percentile of lengths; 0 when nothing moves.
float motion_range(const Image<Vec2f>& motion);

/// Direction as hue (to the right red, down yellow-green, left cyan, up violet), length as
/// whiteness: white stands still, `longest` and more is of full colour.
Image<Rgba8> motion_colors(const Image<Vec2f>& motion, float longest);

}  // namespace diorama
