// SPDX-License-Identifier: Apache-2.0
// How fast the PNG encoder is beside others that Debian has, on the same pictures, in processor
// seconds of one run taken in turns: one line of JSON per picture and encoder. `ratio` compares
// with the fastest encoder whose files are not larger than ours by more than a fiftieth.
#include <libdeflate.h>
#include <png.h>
#ifdef DIORAMA_HAS_SPNG
#include <spng.h>
#endif
#ifdef DIORAMA_HAS_ISAL
#include <isa-l/igzip_lib.h>
#endif

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "diorama/rng.h"
#include "framework/host/machine_limits.h"
#include "framework/images/image_codecs.h"

namespace {

using namespace diorama;
using Bytes = std::vector<std::uint8_t>;

struct Picture {
  std::string name;
  int width = 0;
  int height = 0;
  int channels = 3;
  int bits = 8;
  Bytes samples;

  std::size_t row_bytes() const { return std::size_t(width * channels * bits / 8); }
};

/// A rendering without noise, or with that of few samples.
Picture rendering(int width, int height, double noise) {
  Picture picture{noise > 0.0 ? "noisy" : "smooth", width, height, 3, 8, {}};
  Rng rng(1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double shade = 90.0 + 50.0 * std::sin(0.004 * x) + 40.0 * std::cos(0.007 * y) +
                           (std::hypot(x - 0.6 * width, y - 0.5 * height) < 0.2 * height ? 60 : 0);
      for (int c = 0; c < 3; ++c) {
        const double value = shade * (0.8 + 0.1 * c) + noise * (rng.uniform() - 0.5);
        picture.samples.push_back(std::uint8_t(std::clamp(value, 0.0, 255.0)));
      }
    }
  }
  return picture;
}

/// Ids of discs, 16 bit.
Picture id_map(int width, int height) {
  Picture picture{"ids", width, height, 1, 16, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int cell = (x / 160) + 8 * (y / 160);
      const bool is_disc = std::hypot(x % 160 - 80, y % 160 - 80) < 60;
      const std::uint16_t id = is_disc ? std::uint16_t(cell + 1) : 0;
      picture.samples.push_back(std::uint8_t(id & 255));
      picture.samples.push_back(std::uint8_t(id >> 8));
    }
  }
  return picture;
}

Picture read_picture(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const auto texture = decode_image(std::as_bytes(std::span(text)), file);
  if (texture->bytes.empty()) throw std::runtime_error(file + ": is not a picture of 8 bits");
  return {file, texture->width, texture->height, texture->channels, 8, texture->bytes};
}

std::size_t encode_ours(const Picture& picture) {
  const ImageView view{picture.samples.data(), picture.width, picture.height, picture.channels,
                       picture.bits};
  return encode_image(view, ImageFormat::Png).size();
}

void append(png_structp png, png_bytep data, png_size_t size) {
  auto* out = static_cast<Bytes*>(png_get_io_ptr(png));
  out->insert(out->end(), data, data + size);
}

std::size_t encode_libpng(const Picture& picture, int level) {
  constexpr int kColorType[] = {0, PNG_COLOR_TYPE_GRAY, 0, PNG_COLOR_TYPE_RGB,
                                PNG_COLOR_TYPE_RGB_ALPHA};
  Bytes out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(png, &out, append, nullptr);
  png_set_compression_level(png, level);
  png_set_IHDR(png, info, png_uint_32(picture.width), png_uint_32(picture.height), picture.bits,
               kColorType[picture.channels], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (picture.bits == 16) png_set_swap(png);
  for (int y = 0; y < picture.height; ++y) {
    png_write_row(png, picture.samples.data() + std::size_t(y) * picture.row_bytes());
  }
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return out.size();
}

#ifdef DIORAMA_HAS_SPNG
std::size_t encode_spng(const Picture& picture, int level) {
  constexpr std::uint8_t kColorType[] = {0, SPNG_COLOR_TYPE_GRAYSCALE, 0, SPNG_COLOR_TYPE_TRUECOLOR,
                                         SPNG_COLOR_TYPE_TRUECOLOR_ALPHA};
  spng_ctx* context = spng_ctx_new(SPNG_CTX_ENCODER);
  spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1);
  spng_set_option(context, SPNG_IMG_COMPRESSION_LEVEL, level);
  spng_ihdr header{};
  header.width = std::uint32_t(picture.width);
  header.height = std::uint32_t(picture.height);
  header.color_type = kColorType[picture.channels];
  header.bit_depth = std::uint8_t(picture.bits);
  spng_set_ihdr(context, &header);
  spng_encode_image(context, picture.samples.data(), picture.samples.size(), SPNG_FMT_PNG,
                    SPNG_ENCODE_FINALIZE);
  std::size_t size = 0;
  int error = 0;
  std::free(spng_get_png_buffer(context, &size, &error));
  spng_ctx_free(context);
  return size;
}
#endif

#ifdef DIORAMA_HAS_ISAL
/// Every row by the Paeth filter, then the fastest deflate there is.
std::size_t encode_isal(const Picture& picture) {
  const std::size_t row = picture.row_bytes();
  const auto stride = std::size_t(picture.channels * picture.bits / 8);
  Bytes filtered;
  filtered.reserve((row + 1) * std::size_t(picture.height));
  const Bytes zero(row, 0);
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* from = picture.samples.data() + std::size_t(y) * row;
    const std::uint8_t* above = y > 0 ? from - row : zero.data();
    filtered.push_back(4);
    for (std::size_t i = 0; i < row; ++i) {
      const int left = i < stride ? 0 : from[i - stride];
      const int corner = i < stride ? 0 : above[i - stride];
      const int p = left + above[i] - corner;
      const int a = std::abs(p - left);
      const int b = std::abs(p - above[i]);
      const int c = std::abs(p - corner);
      filtered.push_back(std::uint8_t(from[i] - (a <= b && a <= c ? left
                                                 : b <= c         ? int(above[i])
                                                                  : corner)));
    }
  }
  Bytes out(filtered.size() + filtered.size() / 8 + 4096);
  Bytes buffer(ISAL_DEF_LVL1_DEFAULT);
  isal_zstream stream;
  isal_deflate_stateless_init(&stream);
  stream.level = 1;
  stream.level_buf = buffer.data();
  stream.level_buf_size = std::uint32_t(buffer.size());
  stream.gzip_flag = IGZIP_ZLIB;
  stream.next_in = filtered.data();
  stream.avail_in = std::uint32_t(filtered.size());
  stream.next_out = out.data();
  stream.avail_out = std::uint32_t(out.size());
  stream.end_of_stream = 1;
  stream.flush = NO_FLUSH;
  if (isal_deflate_stateless(&stream) != COMP_OK) throw std::runtime_error("ISA-L failed");
  // Signature, three chunks and the header; the checksum is part of the work.
  [[maybe_unused]] static volatile std::uint32_t checksum;
  checksum = libdeflate_crc32(0, out.data(), stream.total_out);
  return stream.total_out + 57;
}
#endif

struct Encoder {
  std::string name;
  std::function<std::size_t(const Picture&)> encode;
};

std::vector<Encoder> encoders() {
  std::vector<Encoder> list{{"ours", encode_ours}};
  for (const int level : {1, 3, 6}) {
    list.push_back({"libpng zlib " + std::to_string(level),
                    [level](const Picture& picture) { return encode_libpng(picture, level); }});
  }
#ifdef DIORAMA_HAS_SPNG
  for (const int level : {1, 3}) {
    list.push_back({"libspng zlib " + std::to_string(level),
                    [level](const Picture& picture) { return encode_spng(picture, level); }});
  }
#endif
#ifdef DIORAMA_HAS_ISAL
  list.push_back({"ISA-L 1, Paeth", encode_isal});
#endif
  return list;
}

void compare(const Picture& picture, int repetitions) {
  const std::vector<Encoder> list = encoders();
  std::vector<std::vector<double>> seconds(list.size());
  std::vector<std::size_t> sizes(list.size());
  for (int i = 0; i < repetitions; ++i) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      const double start = cpu_seconds();
      sizes[k] = list[k].encode(picture);
      seconds[k].push_back(cpu_seconds() - start);
    }
  }
  std::vector<double> medians;
  for (auto& times : seconds) {
    std::ranges::sort(times);
    medians.push_back(times[times.size() / 2]);
  }
  double fastest = medians[0];
  for (std::size_t k = 1; k < list.size(); ++k) {
    if (double(sizes[k]) <= 1.02 * double(sizes[0])) fastest = std::min(fastest, medians[k]);
  }
  for (std::size_t k = 0; k < list.size(); ++k) {
    nlohmann::ordered_json line{
        {"picture", picture.name},
        {"encoder", list[k].name},
        {"ms", 1000.0 * medians[k]},
        {"share_of_raw", double(sizes[k]) / double(picture.samples.size())}};
    if (k == 0) line["ratio"] = medians[0] / fastest;
    std::printf("%s\n", line.dump().c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> files;
  int repetitions = 15;
  CLI::App app{"Times PNG encoders"};
  app.add_option("files", files, "Pictures to encode beside the made ones");
  app.add_option("--repetitions", repetitions);
  CLI11_PARSE(app, argc, argv);
  try {
    compare(rendering(1280, 720, 0.0), repetitions);
    compare(rendering(1280, 720, 24.0), repetitions);
    compare(id_map(1280, 720), repetitions);
    for (const std::string& file : files) compare(read_picture(file), repetitions);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
