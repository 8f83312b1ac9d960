// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include <jerror.h>
#include <jpeglib.h>

#include <algorithm>
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

/// Each scan goes over all blocks, and a scan of nothing takes a few bytes. Pictures have ten.
constexpr int kMostScans = 100;

void on_progress(j_common_ptr codec) {
  const auto* jpeg = reinterpret_cast<const jpeg_decompress_struct*>(codec);
  if (jpeg->input_scan_number <= kMostScans) return;
  auto* errors = reinterpret_cast<JpegErrors*>(codec->err);
  std::strcpy(errors->message, "it has more than 100 scans");
  std::longjmp(errors->failed, 1);
}

bool read_header(jpeg_decompress_struct& jpeg, JpegErrors& errors, const Source& source) {
  if (setjmp(errors.failed)) return false;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(source.bytes.data()),
               static_cast<unsigned long>(source.bytes.size()));
  jpeg_read_header(&jpeg, TRUE);
  if (jpeg.jpeg_color_space == JCS_YCCK) jpeg.out_color_space = JCS_CMYK;
  jpeg_calc_output_dimensions(&jpeg);
  return true;
}

bool start_rows(jpeg_decompress_struct& jpeg, JpegErrors& errors) {
  if (setjmp(errors.failed)) return false;
  jpeg_start_decompress(&jpeg);
  return true;
}

bool read_row(jpeg_decompress_struct& jpeg, JpegErrors& errors, std::uint8_t* to) {
  if (setjmp(errors.failed)) return false;
  JSAMPROW line = to;
  jpeg_read_scanlines(&jpeg, &line, 1);
  return true;
}

bool read_end(jpeg_decompress_struct& jpeg, JpegErrors& errors) {
  if (setjmp(errors.failed)) return false;
  jpeg_finish_decompress(&jpeg);
  return true;
}

/// Blocks of 8 x 8 samples, by component.
struct BlockCounts {
  std::uint64_t all = 0;
  std::uint64_t fewest = ~std::uint64_t(0);
};

BlockCounts block_counts(const jpeg_decompress_struct& jpeg) {
  BlockCounts counts;
  for (int i = 0; i < jpeg.num_components; ++i) {
    const jpeg_component_info& component = jpeg.comp_info[i];
    const std::uint64_t blocks =
        std::uint64_t(component.width_in_blocks) * component.height_in_blocks;
    counts.all += blocks;
    counts.fewest = std::min(counts.fewest, blocks);
  }
  return counts;
}

/// Refuses what the file is too short for, and what takes too much memory.
void check_sizes(jpeg_decompress_struct& jpeg, const Source& source) {
  source.check_size(jpeg.output_width, jpeg.output_height);
  const BlockCounts blocks = block_counts(jpeg);
  // Huffman codes take a bit at least, and each block of a component that is there has one. The
  // arithmetic coder knows no such limit.
  if (!jpeg.arith_code && blocks.fewest / 8 > source.bytes.size()) {
    source.refuse("damaged JPEG: the file is cut off");
  }
  const bool keeps_blocks = jpeg.progressive_mode || jpeg_has_multiple_scans(&jpeg);
  const std::uint64_t pixels = std::uint64_t(jpeg.output_width) * jpeg.output_height;
  const bool is_cmyk = jpeg.out_color_space == JCS_CMYK;
  source.check_budget(jpeg.output_width, jpeg.output_height,
                      pixels * std::uint64_t(jpeg.out_color_components + (is_cmyk ? 3 : 0)) +
                          (keeps_blocks ? blocks.all * sizeof(JBLOCK) : 0));
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
  const auto require = [&](bool is_good) {
    if (!is_good) source.refuse(std::string("damaged JPEG: ") + errors.message);
  };
  require(read_header(jpeg, errors, source));
  check_sizes(jpeg, source);
  jpeg_progress_mgr progress{};
  progress.progress_monitor = on_progress;
  jpeg.progress = &progress;
  require(start_rows(jpeg, errors));

  Texture texture;
  texture.width = int(jpeg.output_width);
  texture.height = int(jpeg.output_height);
  texture.channels = jpeg.out_color_components;
  GrowingRows<std::uint8_t> rows(
      std::size_t(jpeg.output_width) * std::size_t(jpeg.output_components), jpeg.output_height);
  while (jpeg.output_scanline < jpeg.output_height) require(read_row(jpeg, errors, rows.add()));
  require(read_end(jpeg, errors));
  texture.bytes = rows.take();
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
