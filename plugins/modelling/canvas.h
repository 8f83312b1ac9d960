// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "diorama/image.h"
#include "diorama/material.h"

namespace diorama::modelling {

/// Display-referred (sRGB) colour, 0..1.
using Color = Vec3f;
/// From 0xRRGGBB.
Color color(std::uint32_t rgb);
Color blend(const Color& a, const Color& b, double t);
/// The linear value that a material wants.
Vec3f linear(const Color& srgb);

/// A picture to paint on: x right, y down, in pixels; edges are antialiased.
class Canvas {
 public:
  Canvas(int width, int height, const Color& background);
  int width() const { return image_.width(); }
  int height() const { return image_.height(); }
  Color& at(int x, int y) { return image_.at(x, y); }

  /// Calls shade(x, y) for every pixel centre.
  void shade(const std::function<Color(double, double)>& shader);
  /// Paints where distance(x, y) < 0; distance in pixels. Only pixels of the box are looked at.
  void paint(const PixelBox& box, const std::function<double(double, double)>& distance,
             const Color& color, double opacity = 1.0);
  void rectangle(double x, double y, double width, double height, const Color& color,
                 double corner = 0.0, double opacity = 1.0);
  void ellipse(double x, double y, double radius_x, double radius_y, const Color& color,
               double opacity = 1.0);
  void line(const Vec2& from, const Vec2& to, double width, const Color& color,
            double opacity = 1.0);
  /// A polygon of any kind (even-odd rule).
  void polygon(std::span<const Vec2> points, const Color& color, double opacity = 1.0);
  /// Capital letters, digits and -.&%/ in a stroked face of our own, `height` pixels tall, from the
  /// left end of the base line. Unknown characters leave a gap. Returns the width.
  double text(double x, double y, double height, std::string_view text, const Color& color,
              double weight = 0.14);
  double centred_text(double x, double y, double height, std::string_view text, const Color& color,
                      double weight = 0.14);
  static double text_width(double height, std::string_view text);
  /// Lines of small grey print that only look like text.
  void small_print(double x, double y, double width, double height, int lines, const Color& color,
                   std::uint64_t seed);
  /// A bar code.
  void bar_code(double x, double y, double width, double height, std::uint64_t seed);

  /// 8-bit sRGB, three channels.
  std::shared_ptr<const Texture> texture(std::string_view name) const;

 private:
  Image<Color> image_;
};

}  // namespace diorama::modelling
