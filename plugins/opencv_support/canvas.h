// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/frame.h"
#include "diorama/image.h"

/// Drawing for people to look at: lines, circles and texts have smooth edges, everything is clipped
/// to the picture. Opaque ink replaces, translucent ink blends ("over", on straight alpha), and
/// each call inks a pixel once. Positions are pixel coordinates, the centre of the top left pixel
/// is (0.5, 0.5).
namespace diorama {

void draw_line(Image<Rgba8>& picture, const Vec2& a, const Vec2& b, int width, const Rgba8& color);

void fill_circle(Image<Rgba8>& picture, const Vec2& centre, double radius, const Rgba8& color);

void fill_rectangle(Image<Rgba8>& picture, const PixelBox& box, const Rgba8& color);

/// A border of `width` pixels inside the box's edge.
void draw_rectangle(Image<Rgba8>& picture, const PixelBox& box, int width, const Rgba8& color);

/// A straight line in world space as the camera sees it: clipped at the near plane, and bent where
/// the lens bends it.
void draw_world_line(Image<Rgba8>& picture, const Frame& frame, const Vec3& a_world,
                     const Vec3& b_world, int width, const Rgba8& color);

/// The pixels of `id`, with a smooth outline of `width` pixels in full ink round them.
void fill_mask(Image<Rgba8>& picture, const Image<std::uint32_t>& ids, std::uint32_t id,
               const PixelBox& box, int width, const Rgba8& color);

/// Height in pixels that letters have for people who look at a picture of this size.
int text_height(const Image<Rgba8>& picture);

/// A text on a plate of `color` that stands on the box's upper edge; where the picture ends, below
/// the box, else inside it. Black or white, whichever is seen better. Letters beyond ASCII are
/// shown as '?'.
void draw_tag(Image<Rgba8>& picture, const PixelBox& box, const std::string& text,
              const Rgba8& color);

}  // namespace diorama
