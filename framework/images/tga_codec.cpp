// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstring>

#include "framework/images/codecs.h"

// Truevision TGA 2.0 (file format specification, 1991): grey, RGB and palette pictures, plain or
// run coded. Attribute bits of 16-bit pixels are ignored.
namespace diorama::images {
namespace {

using Pixel = std::array<std::uint8_t, 4>;  // RGBA, or grey in the first

class TgaReader {
 public:
  explicit TgaReader(const Source& source) : source_(source) {}

  Texture read() {
    read_header();
    source_.check_size(width_, height_);
    const std::size_t count = std::size_t(width_) * height_;
    // A run holds at most 128 pixels and is its head and one pixel.
    const std::size_t pixel_size = (bits_ + 7) / 8;
    const std::size_t least = is_run_coded_ ? (count + 127) / 128 * (1 + pixel_size)  //
                                            : count * pixel_size;
    if (least > source_.bytes.size()) cut_off();
    source_.check_budget(width_, height_, count * (sizeof(Pixel) + channels()));
    read_palette();
    std::vector<Pixel> pixels;
    pixels.reserve(count);
    while (pixels.size() < count) read_packet(pixels, count);
    return oriented(pixels);
  }

 private:
  [[noreturn]] void cut_off() const { source_.refuse("damaged TGA: the file is cut off"); }
  [[noreturn]] void refuse(const std::string& reason) const {
    source_.refuse("damaged TGA: " + reason);
  }
  std::uint32_t u8() {
    if (at_ >= source_.bytes.size()) cut_off();
    return std::uint32_t(source_.bytes[at_++]);
  }
  std::uint32_t u16() {
    const std::uint32_t low = u8();
    return low | u8() << 8;
  }

  void read_header() {
    const std::uint32_t id_size = u8();
    const std::uint32_t has_palette = u8();
    const std::uint32_t type = u8();
    palette_first_ = u16();
    palette_count_ = has_palette == 1 ? u16() : (u16(), 0u);
    palette_bits_ = u8();
    at_ += 4;  // origin on a screen
    width_ = u16();
    height_ = u16();
    bits_ = u8();
    const std::uint32_t flags = u8();
    is_from_right_ = (flags & 0x10) != 0;
    is_from_top_ = (flags & 0x20) != 0;
    at_ += id_size;
    is_run_coded_ = type >= 9 && type <= 11;
    kind_ = is_run_coded_ ? type - 8 : type;
    const bool is_known =
        (kind_ == 1 && has_palette == 1 && (bits_ == 8 || bits_ == 16)) ||
        (kind_ == 2 && (bits_ == 15 || bits_ == 16 || bits_ == 24 || bits_ == 32)) ||
        (kind_ == 3 && bits_ == 8);
    if (!is_known) {
      refuse("pixels of type " + std::to_string(type) + " with " + std::to_string(bits_) +
             " bits are not read");
    }
  }

  void read_palette() {
    const bool is_known =
        palette_bits_ == 15 || palette_bits_ == 16 || palette_bits_ == 24 || palette_bits_ == 32;
    if (palette_count_ > 0 && !is_known) refuse("its palette has entries of unknown size");
    for (std::uint32_t i = 0; i < palette_count_; ++i) palette_.push_back(color(palette_bits_));
  }

  Pixel color(std::uint32_t bits) {
    if (bits <= 16) {
      const std::uint32_t value = u16();
      const auto five = [&](int shift) {
        const std::uint32_t v = value >> shift & 31;
        return std::uint8_t(v << 3 | v >> 2);
      };
      return {five(10), five(5), five(0), 255};
    }
    const auto blue = std::uint8_t(u8());
    const auto green = std::uint8_t(u8());
    const auto red = std::uint8_t(u8());
    return {red, green, blue, bits == 32 ? std::uint8_t(u8()) : std::uint8_t(255)};
  }

  Pixel pixel() {
    if (kind_ == 3) return {std::uint8_t(u8()), 0, 0, 255};
    if (kind_ == 2) return color(bits_);
    const std::uint32_t index = bits_ == 8 ? u8() : u16();
    if (index < palette_first_ || index - palette_first_ >= palette_.size()) {
      refuse("a pixel lies outside of the palette");
    }
    return palette_[index - palette_first_];
  }

  void read_packet(std::vector<Pixel>& pixels, std::size_t count) {
    if (!is_run_coded_) {
      pixels.push_back(pixel());
      return;
    }
    const std::uint32_t head = u8();
    const std::size_t length = (head & 127) + 1;
    if (length > count - pixels.size()) refuse("a run is longer than the image");
    if (head & 128) {
      pixels.insert(pixels.end(), length, pixel());
    } else {
      for (std::size_t i = 0; i < length; ++i) pixels.push_back(pixel());
    }
  }

  std::size_t channels() const {
    if (kind_ == 3) return 1;
    return (kind_ == 1 ? palette_bits_ : bits_) == 32 ? 4 : 3;
  }

  Texture oriented(const std::vector<Pixel>& pixels) const {
    Texture texture;
    texture.width = int(width_);
    texture.height = int(height_);
    texture.channels = int(channels());
    texture.bytes.reserve(pixels.size() * channels());
    for (std::size_t y = 0; y < height_; ++y) {
      const std::size_t row = is_from_top_ ? y : height_ - 1 - y;
      for (std::size_t x = 0; x < width_; ++x) {
        const std::size_t column = is_from_right_ ? width_ - 1 - x : x;
        const Pixel& from = pixels[row * width_ + column];
        texture.bytes.insert(texture.bytes.end(), from.begin(),
                             from.begin() + std::ptrdiff_t(channels()));
      }
    }
    return texture;
  }

  const Source& source_;
  std::size_t at_ = 0;
  std::uint32_t kind_ = 0;  // 1 palette, 2 colour, 3 grey
  bool is_run_coded_ = false;
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
  std::uint32_t bits_ = 0;
  bool is_from_right_ = false;
  bool is_from_top_ = false;
  std::uint32_t palette_first_ = 0;
  std::uint32_t palette_count_ = 0;
  std::uint32_t palette_bits_ = 0;
  std::vector<Pixel> palette_;
};

}  // namespace

Texture decode_tga(const Source& source) { return TgaReader(source).read(); }

}  // namespace diorama::images
