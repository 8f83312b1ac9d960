// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "framework/images/codecs.h"

// Radiance RGBE: G. Ward, "Real Pixels", Graphics Gems II, 1991, and the Radiance reference manual,
// "filefmts". A pixel is three mantissas and one shared exponent of base 2, biased by 128.
namespace diorama::images {
namespace {

using Rgbe = std::array<std::uint8_t, 4>;

void to_floats(const Rgbe& pixel, float* to) {
  const float scale = pixel[3] == 0 ? 0.0f : std::ldexp(1.0f, int(pixel[3]) - (128 + 8));
  for (std::size_t c = 0; c < 3; ++c) to[c] = float(pixel[c]) * scale;
}

Rgbe to_rgbe(const float* rgb) {
  std::array<float, 3> value;
  for (std::size_t c = 0; c < 3; ++c) {
    value[c] = std::isnan(rgb[c]) ? 0.0f : std::clamp(rgb[c], 0.0f, 1.6e38f);
  }
  const float largest = std::max({value[0], value[1], value[2]});
  if (largest < 1e-37f) return {0, 0, 0, 0};
  int exponent = 0;
  std::frexp(largest, &exponent);
  // Rounding up the largest mantissa may reach 256, then the next exponent holds it.
  if (std::lround(std::ldexp(largest, 8 - exponent)) > 255) ++exponent;
  Rgbe pixel;
  for (std::size_t c = 0; c < 3; ++c) {
    pixel[c] = std::uint8_t(std::lround(std::ldexp(value[c], 8 - exponent)));
  }
  pixel[3] = std::uint8_t(std::clamp(exponent + 128, 0, 255));
  return pixel;
}

class HdrReader {
 public:
  explicit HdrReader(const Source& source) : source_(source) {}

  Texture read() {
    read_header();
    const bool is_from_top = read_size();
    const std::size_t width = std::size_t(texture_.width);
    const std::size_t height = std::size_t(texture_.height);
    source_.check_size(width, height);
    // A pixel of its own and up to two old-style runs make the shortest row.
    const std::size_t shortest_row = width == 1 ? 4 : width <= 256 ? 8 : 12;
    if (shortest_row * height > source_.bytes.size()) cut_off();
    const std::size_t row_size = 3 * width;
    source_.check_budget(width, height, row_size * height * sizeof(float));
    GrowingRows<float> rows(row_size, height);
    std::vector<Rgbe> row(width);
    for (std::size_t y = 0; y < height; ++y) {
      read_row(row);
      float* floats = rows.add();
      for (std::size_t x = 0; x < width; ++x) {
        to_floats(row[x], floats + 3 * x);
        for (std::size_t c = 0; c < 3; ++c) floats[3 * x + c] *= float(1.0 / exposure_);
      }
    }
    texture_.channels = 3;
    texture_.floats = rows.take();
    if (!is_from_top) turn_rows(texture_.floats, row_size);
    return std::move(texture_);
  }

 private:
  [[noreturn]] void cut_off() const { source_.refuse("damaged HDR: the file is cut off"); }
  [[noreturn]] void refuse(const std::string& reason) const {
    source_.refuse("damaged HDR: " + reason);
  }

  std::uint8_t next() {
    if (at_ >= source_.bytes.size()) cut_off();
    return std::uint8_t(source_.bytes[at_++]);
  }

  std::string next_line() {
    std::string line;
    for (char c = char(next()); c != '\n'; c = char(next())) {
      if (line.size() > 1000) refuse("its header holds a line without end");
      line += c;
    }
    return line;
  }

  void read_header() {
    next_line();
    for (std::string line = next_line(); !line.empty(); line = next_line()) {
      if (line.starts_with("FORMAT=") && !line.starts_with("FORMAT=32-bit_rle_rgbe")) {
        refuse("its pixels are '" + line.substr(7) + "', 32-bit_rle_rgbe is read");
      }
      if (line.starts_with("EXPOSURE=")) read_exposure(line.substr(9));
    }
  }

  /// Values in the file were multiplied by every exposure in the header.
  void read_exposure(std::string_view text) {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    double factor = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), factor);
    if (failed != std::errc() || !(factor > 1e-30 && factor < 1e30)) {
      refuse("its EXPOSURE is no positive number");
    }
    exposure_ *= factor;
  }

  /// True for "-Y h +X w" (rows from the top), false for "+Y h +X w".
  bool read_size() {
    const std::string line = next_line();
    char y_sign = 0;
    char x_sign = 0;
    int used = 0;
    if (std::sscanf(line.c_str(), "%cY %6d %cX %6d%n", &y_sign, &texture_.height, &x_sign,
                    &texture_.width, &used) != 4 ||
        std::size_t(used) != line.size() || x_sign != '+' || (y_sign != '-' && y_sign != '+')) {
      refuse("its size line is '" + line + "', '-Y height +X width' is read");
    }
    return y_sign == '-';
  }

  void read_row(std::vector<Rgbe>& row) {
    const Rgbe first{next(), next(), next(), next()};
    const std::size_t coded_width = std::size_t(first[2]) << 8 | first[3];
    const bool is_run_coded =
        first[0] == 2 && first[1] == 2 && first[2] < 128 && row.size() >= 8 && row.size() <= 0x7fff;
    if (!is_run_coded) return read_old_row(row, first);
    if (coded_width != row.size()) refuse("a row has another width than the image");
    for (std::size_t c = 0; c < 4; ++c) read_plane(row, c);
  }

  void read_plane(std::vector<Rgbe>& row, std::size_t c) {
    for (std::size_t x = 0; x < row.size();) {
      const std::size_t code = next();
      const bool is_run = code > 128;
      const std::size_t count = is_run ? code - 128 : code;
      if (count == 0 || count > row.size() - x) refuse("a run is longer than its row");
      const std::uint8_t value = is_run ? next() : 0;
      for (std::size_t i = 0; i < count; ++i) row[x++][c] = is_run ? value : next();
    }
  }

  /// Flat pixels; (1, 1, 1, n) repeats the last one n times, n of following ones count 256-fold.
  void read_old_row(std::vector<Rgbe>& row, Rgbe pixel) {
    int shift = 0;
    for (std::size_t x = 0; x < row.size();) {
      if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
        const std::size_t count = std::size_t(pixel[3]) << shift;
        if (x == 0 || shift > 16 || count > row.size() - x) refuse("a run is longer than its row");
        const Rgbe last = row[x - 1];
        for (std::size_t i = 0; i < count; ++i) row[x++] = last;
        shift += 8;
      } else {
        row[x++] = pixel;
        shift = 0;
      }
      if (x < row.size()) pixel = {next(), next(), next(), next()};
    }
  }

  const Source& source_;
  std::size_t at_ = 0;
  Texture texture_;
  double exposure_ = 1.0;
};

void put(std::vector<std::byte>& file, std::size_t byte) { file.push_back(std::byte(byte)); }

/// One mantissa or exponent plane of a row: runs of 4 or more, everything else literally.
void put_plane(std::vector<std::byte>& file, const std::vector<Rgbe>& row, std::size_t c) {
  const auto run_at = [&](std::size_t x) {
    std::size_t end = x + 1;
    while (end < row.size() && end - x < 127 && row[end][c] == row[x][c]) ++end;
    return end - x;
  };
  for (std::size_t x = 0; x < row.size();) {
    const std::size_t run = run_at(x);
    if (run >= 4) {
      put(file, 128 + run);
      put(file, row[x][c]);
      x += run;
      continue;
    }
    std::size_t end = x;
    while (end < row.size() && end - x < 128 && run_at(end) < 4) ++end;
    put(file, end - x);
    for (; x < end; ++x) put(file, row[x][c]);
  }
}

}  // namespace

Texture decode_hdr(const Source& source) { return HdrReader(source).read(); }

std::vector<std::byte> encode_hdr(const ImageView& image) {
  const std::string header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " +
                             std::to_string(image.height) + " +X " + std::to_string(image.width) +
                             "\n";
  std::vector<std::byte> file;
  for (const char c : header) file.push_back(std::byte(c));
  const auto* floats = static_cast<const float*>(image.data);
  std::vector<Rgbe> row(std::size_t(image.width));
  for (int y = 0; y < image.height; ++y) {
    for (Rgbe& pixel : row) {
      pixel = to_rgbe(floats);
      floats += 3;
    }
    if (row.size() < 8) {  // too narrow for run coding
      for (const Rgbe& pixel : row) {
        for (const std::uint8_t byte : pixel) put(file, byte);
      }
      continue;
    }
    for (const std::size_t byte :
         {std::size_t(2), std::size_t(2), row.size() >> 8, row.size() & 255}) {
      put(file, byte);
    }
    for (std::size_t c = 0; c < 4; ++c) put_plane(file, row, c);
  }
  return file;
}

}  // namespace diorama::images
