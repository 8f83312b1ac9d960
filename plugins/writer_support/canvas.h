// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/frame.h"
#include "diorama/image.h"

/// Drawing for people to look at: no anti-aliasing, everything clipped to the picture. Positions
/// are pixel coordinates, the centre of the top left pixel is (0.5, 0.5).
namespace diorama {

/// Opaque pixels replace, translucent ones blend ("over", on straight alpha).
void draw_pixel(Image<Rgba8>& picture, int x, int y, const Rgba8& color);

void draw_line(Image<Rgba8>& picture, const Vec2& a, const Vec2& b, int width, const Rgba8& color);

void fill_circle(Image<Rgba8>& picture, const Vec2& centre, double radius, const Rgba8& color);

void fill_rectangle(Image<Rgba8>& picture, const PixelBox& box, const Rgba8& color);

/// A border of `width` pixels inside the box's edge.
void draw_rectangle(Image<Rgba8>& picture, const PixelBox& box, int width, const Rgba8& color);

/// A straight line in world space as the camera sees it: clipped at the near plane, and bent where
/// the lens bends it.
void draw_world_line(Image<Rgba8>& picture, const Frame& frame, const Vec3& a_world,
                     const Vec3& b_world, int width, const Rgba8& color);

}  // namespace diorama
