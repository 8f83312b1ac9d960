// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "framework/images/codecs.h"

// Windows bitmap (Microsoft, BITMAPINFOHEADER and later): 8-bit palette, 24 and 32 bit, not
// compressed.
namespace diorama::images {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

class BmpReader {
 public:
  explicit BmpReader(const Source& source) : source_(source) {}

  Texture read() {
    const std::uint64_t pixels_at = u32(10);
    const std::uint64_t header_size = u32(14);
    if (header_size < 40) refuse("its header is older than Windows 3.0");
    const auto width = std::int32_t(u32(18));
    const auto height = std::int32_t(u32(22));
    bits_ = u16(28);
    check_kind(u32(30), header_size);
    const bool is_from_top = height < 0;
    const std::uint64_t rows =
        std::uint64_t(std::int64_t(height) < 0 ? -std::int64_t(height) : height);
    source_.check_size(width < 0 ? 0 : std::uint64_t(width), rows);
    const std::uint64_t stride = (std::uint64_t(width) * bits_ / 8 + 3) / 4 * 4;
    if (pixels_at > source_.bytes.size() || stride * rows > source_.bytes.size() - pixels_at) {
      cut_off();
    }
    source_.check_budget(std::uint64_t(width), rows, std::uint64_t(width) * rows * 3);
    if (bits_ == 8) read_palette(14 + header_size, pixels_at);
    Texture texture;
    texture.width = width;
    texture.height = int(rows);
    texture.channels = 3;
    texture.bytes.reserve(std::size_t(width) * rows * 3);
    for (std::uint64_t y = 0; y < rows; ++y) {
      const std::uint64_t row = pixels_at + stride * (is_from_top ? y : rows - 1 - y);
      for (std::uint64_t x = 0; x < std::uint64_t(width); ++x) {
        const Rgb color = bits_ == 8 ? palette_color(u8(row + x)) : bgr(row + x * bits_ / 8);
        texture.bytes.insert(texture.bytes.end(), color.begin(), color.end());
      }
    }
    return texture;
  }

 private:
  [[noreturn]] void cut_off() const { source_.refuse("damaged BMP: the file is cut off"); }
  [[noreturn]] void refuse(const std::string& reason) const {
    source_.refuse("damaged BMP: " + reason);
  }
  std::uint32_t u8(std::uint64_t at) const {
    if (at >= source_.bytes.size()) cut_off();
    return std::uint32_t(source_.bytes[at]);
  }
  std::uint32_t u16(std::uint64_t at) const { return u8(at) | u8(at + 1) << 8; }
  std::uint32_t u32(std::uint64_t at) const { return u16(at) | u16(at + 2) << 16; }
  Rgb bgr(std::uint64_t at) const {
    return {std::uint8_t(u8(at + 2)), std::uint8_t(u8(at + 1)), std::uint8_t(u8(at))};
  }

  /// Bit fields are read where they say what 32-bit pixels are anyway.
  void check_kind(std::uint32_t compression, std::uint64_t header_size) const {
    const bool is_plain = compression == 0 && (bits_ == 8 || bits_ == 24 || bits_ == 32);
    const bool has_usual_fields = compression == 3 && bits_ == 32 && header_size >= 40 &&
                                  u32(54) == 0xFF0000 && u32(58) == 0xFF00 && u32(62) == 0xFF;
    if (is_plain || has_usual_fields) return;
    refuse("pixels of " + std::to_string(bits_) + " bits with compression " +
           std::to_string(compression) + " are not read");
  }

  void read_palette(std::uint64_t at, std::uint64_t end) {
    for (; at + 4 <= end && palette_.size() < 256; at += 4) palette_.push_back(bgr(at));
  }
  Rgb palette_color(std::uint32_t index) const {
    if (index >= palette_.size()) refuse("a pixel lies outside of the palette");
    return palette_[index];
  }

  const Source& source_;
  std::uint64_t bits_ = 0;
  std::vector<Rgb> palette_;
};

}  // namespace

Texture decode_bmp(const Source& source) { return BmpReader(source).read(); }

}  // namespace diorama::images
