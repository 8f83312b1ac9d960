// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "framework/images/codecs.h"

// JPEG by libjpeg(-turbo), which reports errors by longjmp: nothing with a destructor lives in the
// functions that call it.
namespace diorama::images {
namespace {

constexpr int kQuality = 75;

struct JpegErrors {
  jpeg_error_mgr base;  // first: libjpeg knows this part only
  std::jmp_buf failed;
  char message[JMSG_LENGTH_MAX] = {};
};

[[noreturn]] void on_error(j_common_ptr codec) {
  auto* errors = reinterpret_cast<JpegErrors*>(codec->err);
  codec->err->format_message(codec, errors->message);
  std::longjmp(errors->failed, 1);
}

/// libjpeg goes on with grey pixels after damage; for us that is an error.
void on_message(j_common_ptr codec, int level) {
  if (level >= 0) return;
  const int code = codec->err->msg_code;
  const bool is_harmless = code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM;
  if (!is_harmless) on_error(codec);
}

void connect(JpegErrors& errors) {
  jpeg_std_error(&errors.base);
  errors.base.error_exit = on_error;
  errors.base.emit_message = on_message;
  errors.base.output_message = [](j_common_ptr) {};
}

bool start_read(jpeg_decompress_struct& jpeg, JpegErrors& errors, const Source& source) {
  if (setjmp(errors.failed)) return false;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(source.bytes.data()),
               static_cast<unsigned long>(source.bytes.size()));
  jpeg_read_header(&jpeg, TRUE);
  if (jpeg.jpeg_color_space == JCS_YCCK) jpeg.out_color_space = JCS_CMYK;
  jpeg_calc_output_dimensions(&jpeg);
  return true;
}

bool read_pixels(jpeg_decompress_struct& jpeg, JpegErrors& errors, std::uint8_t* to) {
  if (setjmp(errors.failed)) return false;
  jpeg_start_decompress(&jpeg);
  const std::size_t row = std::size_t(jpeg.output_width) * std::size_t(jpeg.output_components);
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW line = to + row * jpeg.output_scanline;
    jpeg_read_scanlines(&jpeg, &line, 1);
  }
  jpeg_finish_decompress(&jpeg);
  return true;
}

/// CMYK as Adobe writes it (inverted) or not, by the simple product rule.
std::vector<std::uint8_t> rgb_of_cmyk(const std::vector<std::uint8_t>& cmyk, bool is_inverted) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(cmyk.size() / 4 * 3);
  for (std::size_t i = 0; i + 3 < cmyk.size(); i += 4) {
    const int key = is_inverted ? cmyk[i + 3] : 255 - cmyk[i + 3];
    for (std::size_t c = 0; c < 3; ++c) {
      const int ink = is_inverted ? cmyk[i + c] : 255 - cmyk[i + c];
      rgb.push_back(std::uint8_t((ink * key + 127) / 255));
    }
  }
  return rgb;
}

/// `out` is allocated by libjpeg with malloc.
bool write_pixels(jpeg_compress_struct& jpeg, JpegErrors& errors, const ImageView& image,
                  unsigned char** out, unsigned long* size) {
  if (setjmp(errors.failed)) return false;
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, out, size);
  jpeg.image_width = JDIMENSION(image.width);
  jpeg.image_height = JDIMENSION(image.height);
  jpeg.input_components = image.channels;
  jpeg.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, kQuality, TRUE);
  jpeg.dct_method = JDCT_ISLOW;  // the one whose vector versions give the same bits
  jpeg_start_compress(&jpeg, TRUE);
  const std::size_t row = std::size_t(image.width) * std::size_t(image.channels);
  const auto* pixels = static_cast<const JSAMPLE*>(image.data);
  while (jpeg.next_scanline < jpeg.image_height) {
    auto* line = const_cast<JSAMPROW>(pixels + row * jpeg.next_scanline);
    jpeg_write_scanlines(&jpeg, &line, 1);
  }
  jpeg_finish_compress(&jpeg);
  return true;
}

}  // namespace

Texture decode_jpeg(const Source& source) {
  JpegErrors errors{};
  connect(errors);
  jpeg_decompress_struct jpeg{};
  jpeg.err = &errors.base;
  const auto destroy = [](jpeg_decompress_struct* codec) { jpeg_destroy_decompress(codec); };
  const std::unique_ptr<jpeg_decompress_struct, decltype(destroy)> owner(&jpeg, destroy);
  if (!start_read(jpeg, errors, source)) {
    source.refuse(std::string("damaged JPEG: ") + errors.message);
  }
  source.check_size(jpeg.output_width, jpeg.output_height);
  Texture texture;
  texture.width = int(jpeg.output_width);
  texture.height = int(jpeg.output_height);
  texture.channels = jpeg.out_color_components;
  texture.bytes.resize(std::size_t(texture.width) * std::size_t(texture.height) *
                       std::size_t(texture.channels));
  if (!read_pixels(jpeg, errors, texture.bytes.data())) {
    source.refuse(std::string("damaged JPEG: ") + errors.message);
  }
  if (jpeg.out_color_space == JCS_CMYK) {
    texture.bytes = rgb_of_cmyk(texture.bytes, jpeg.saw_Adobe_marker);
    texture.channels = 3;
  }
  return texture;
}

std::vector<std::byte> encode_jpeg(const ImageView& image) {
  JpegErrors errors{};
  connect(errors);
  jpeg_compress_struct jpeg{};
  jpeg.err = &errors.base;
  unsigned char* out = nullptr;
  unsigned long size = 0;
  const bool is_done = write_pixels(jpeg, errors, image, &out, &size);
  const std::unique_ptr<unsigned char, void (*)(void*)> owner(out, std::free);
  jpeg_destroy_compress(&jpeg);
  if (!is_done) throw Error(ErrorKind::Internal, std::string("JPEG encoder: ") + errors.message);
  const auto* begin = reinterpret_cast<const std::byte*>(out);
  return {begin, begin + size};
}

}  // namespace diorama::images
