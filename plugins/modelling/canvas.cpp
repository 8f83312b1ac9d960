// SPDX-License-Identifier: Apache-2.0
#include "modelling/canvas.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "modelling/noise.h"

namespace diorama::modelling {
namespace {

/// Strokes of a glyph on a grid 4 wide and 6 tall: digit pairs x y, strokes parted by spaces.
struct Glyph {
  char letter;
  const char* strokes;
};
constexpr Glyph kGlyphs[] = {
    {'A', "002640 1232"},
    {'B', "000636454433 0333424130 3000"},
    {'C', "45361605011030 3041"},
    {'D', "00062644422000"},
    {'E', "46060040 0333"},
    {'F', "460600 0333"},
    {'G', "4536160501103041 414323"},
    {'H', "0006 4046 0343"},
    {'I', "2026"},
    {'J', "4641301001"},
    {'K', "0006 4602 1340"},
    {'L', "060040"},
    {'M', "0006234640"},
    {'N', "00064046"},
    {'O', "1030414536160501 0110"},
    {'P', "0006364544330333 0303"},
    {'Q', "1030414536160501 0110 2240"},
    {'R', "000636454433 3303 2340"},
    {'S', "4536160504133342413010 1001"},
    {'T', "0646 2620"},
    {'U', "060110304146"},
    {'V', "062046"},
    {'W', "0610243046"},
    {'X', "0046 0640"},
    {'Y', "062346 2320"},
    {'Z', "06460040"},
    {'0', "1030414536160501 0110"},
    {'1', "152620 1030"},
    {'2', "05163645440040"},
    {'3', "0516364544332342413010 1001"},
    {'4', "30360242"},
    {'5', "4606033342413010"},
    {'6', "453616050110304142330302"},
    {'7', "064620"},
    {'8', "1333444536160504130201103041423313"},
    {'9', "0110304145361605041343"},
    {'-', "1333"},
    {'.', "2020"},
    {'/', "0046"},
    {'%', "0046 0606 4040"},
    {'&', "4004152635330201103042"},
};

const char* strokes_of(char letter) {
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.letter == letter) return glyph.strokes;
  }
  return nullptr;
}

double distance_to_segment(const Vec2& p, const Vec2& a, const Vec2& b) {
  const Vec2 ab = b - a;
  const double t = std::clamp(ab.dot(p - a) / std::max(1e-12, ab.squaredNorm()), 0.0, 1.0);
  return (p - a - t * ab).norm();
}

PixelBox box_around(double x0, double y0, double x1, double y1) {
  return {int(std::floor(x0)) - 1, int(std::floor(y0)) - 1, int(std::ceil(x1)) + 2,
          int(std::ceil(y1)) + 2};
}

}  // namespace

Color color(std::uint32_t rgb) {
  return Color(float(rgb >> 16 & 255), float(rgb >> 8 & 255), float(rgb & 255)) / 255.0f;
}

Color blend(const Color& a, const Color& b, double t) {
  const auto share = float(std::clamp(t, 0.0, 1.0));
  return (1 - share) * a + share * b;
}

Vec3f linear(const Color& srgb) {
  return {linear_from_srgb(srgb.x()), linear_from_srgb(srgb.y()), linear_from_srgb(srgb.z())};
}

Canvas::Canvas(int width, int height, const Color& background)
    : image_(width, height, background) {}

void Canvas::shade(const std::function<Color(double, double)>& shader) {
  for (int y = 0; y < height(); ++y) {
    for (int x = 0; x < width(); ++x) image_.at(x, y) = shader(x + 0.5, y + 0.5);
  }
}

void Canvas::paint(const PixelBox& box, const std::function<double(double, double)>& distance,
                   const Color& color, double opacity) {
  const PixelBox part = box.clipped(width(), height());
  for (int y = part.y_min; y < part.y_max; ++y) {
    for (int x = part.x_min; x < part.x_max; ++x) {
      const double cover = std::clamp(0.5 - distance(x + 0.5, y + 0.5), 0.0, 1.0);
      if (cover > 0) image_.at(x, y) = blend(image_.at(x, y), color, cover * opacity);
    }
  }
}

void Canvas::rectangle(double x, double y, double width, double height, const Color& color,
                       double corner, double opacity) {
  const double cx = x + width / 2, cy = y + height / 2;
  paint(
      box_around(x, y, x + width, y + height),
      [&](double px, double py) {
        const double dx = std::abs(px - cx) - width / 2 + corner;
        const double dy = std::abs(py - cy) - height / 2 + corner;
        return std::hypot(std::max(dx, 0.0), std::max(dy, 0.0)) + std::min(std::max(dx, dy), 0.0) -
               corner;
      },
      color, opacity);
}

void Canvas::ellipse(double x, double y, double radius_x, double radius_y, const Color& color,
                     double opacity) {
  paint(
      box_around(x - radius_x, y - radius_y, x + radius_x, y + radius_y),
      [&](double px, double py) {
        const double k = std::hypot((px - x) / radius_x, (py - y) / radius_y);
        return (k - 1) * std::min(radius_x, radius_y);
      },
      color, opacity);
}

void Canvas::line(const Vec2& from, const Vec2& to, double width, const Color& color,
                  double opacity) {
  const double r = width / 2;
  paint(
      box_around(std::min(from.x(), to.x()) - r, std::min(from.y(), to.y()) - r,
                 std::max(from.x(), to.x()) + r, std::max(from.y(), to.y()) + r),
      [&](double x, double y) {
        return distance_to_segment({x, y}, from, to) - r;
      },
      color, opacity);
}

void Canvas::polygon(std::span<const Vec2> points, const Color& color, double opacity) {
  Vec2 low = points[0], high = points[0];
  for (const Vec2& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const std::size_t n = points.size();
  paint(
      box_around(low.x(), low.y(), high.x(), high.y()),
      [&](double x, double y) {
        const Vec2 p(x, y);
        double nearest = 1e9;
        bool is_in = false;
        for (std::size_t i = 0; i < n; ++i) {
          const Vec2& a = points[i];
          const Vec2& b = points[(i + 1) % n];
          nearest = std::min(nearest, distance_to_segment(p, a, b));
          if ((a.y() > y) != (b.y() > y) &&
              x < (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y()) + a.x()) {
            is_in = !is_in;
          }
        }
        return is_in ? -nearest : nearest;
      },
      color, opacity);
}

double Canvas::text_width(double height, std::string_view text) {
  const double advance = height / 6 * 5.6;
  return std::max(0.0, advance * double(text.size()) - height / 6 * 1.6);
}

double Canvas::text(double x, double y, double height, std::string_view text, const Color& color,
                    double weight) {
  const double unit = height / 6;
  double pen = x;
  for (const char letter : text) {
    const char* strokes = strokes_of(letter);
    Vec2 last;
    bool is_down = false;
    for (const char* s = strokes; s != nullptr && *s != 0;) {
      if (*s == ' ') {
        is_down = false;
        ++s;
        continue;
      }
      const Vec2 point(pen + unit * (s[0] - '0'), y - unit * (s[1] - '0'));
      if (is_down) line(last, point, weight * height, color);
      last = point;
      is_down = true;
      s += 2;
    }
    pen += letter == ' ' ? 4 * unit : 5.6 * unit;
  }
  return pen - x;
}

double Canvas::centred_text(double x, double y, double height, std::string_view text,
                            const Color& color, double weight) {
  return this->text(x - text_width(height, text) / 2, y, height, text, color, weight);
}

void Canvas::small_print(double x, double y, double width, double height, int lines,
                         const Color& color, std::uint64_t seed) {
  const double pitch = height / lines;
  for (int row = 0; row < lines; ++row) {
    const double end = row + 1 == lines ? 0.6 * width : width;
    double pen = 0.0;
    for (int word = 0; pen < end; ++word) {
      const double length = pitch * (0.8 + 2.6 * lattice_value(seed, word, row));
      const double clipped = std::min(length, end - pen);
      rectangle(x + pen, y + row * pitch + 0.3 * pitch, clipped, 0.38 * pitch, color, 0.0, 0.8);
      pen += length + 0.5 * pitch;
    }
  }
}

void Canvas::bar_code(double x, double y, double width, double height, std::uint64_t seed) {
  rectangle(x, y, width, height, Color::Ones());
  const double unit = width / 64;
  double pen = 4 * unit;
  for (int bar = 0; pen < 58 * unit; ++bar) {
    const double thick = unit * (1 + std::floor(3 * lattice_value(seed, bar, 0)));
    rectangle(x + pen, y + 0.08 * height, thick, 0.72 * height, Color::Constant(0.05f));
    pen += thick + unit * (1 + std::floor(2 * lattice_value(seed, bar, 1)));
  }
  small_print(x + 4 * unit, y + 0.8 * height, 54 * unit, 0.18 * height, 1, Color::Constant(0.05f),
              seed);
}

std::shared_ptr<const Texture> Canvas::texture(std::string_view name) const {
  Texture result;
  result.name = std::string(name);
  result.width = width();
  result.height = height();
  result.channels = 3;
  result.color_space = ColorSpace::Srgb;
  result.bytes.reserve(std::size_t(width()) * std::size_t(height()) * 3);
  for (const Color& pixel : image_.pixels()) {
    for (int c = 0; c < 3; ++c) {
      const float value = std::clamp(pixel[c], 0.0f, 1.0f);
      result.bytes.push_back(std::uint8_t(value * 255.0f + 0.5f));
    }
  }
  return std::make_shared<const Texture>(std::move(result));
}

}  // namespace diorama::modelling
