// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <stdexcept>

#include "framework/images/codecs.h"
#include "framework/images/opencv_pictures.h"
#include "framework/plugins/on_demand_library.h"

// TIFF, WebP and JPEG 2000 are decoded by OpenCV. Their headers are looked at here, before that:
// OpenCV's codecs believe what they say.
namespace diorama::images {
namespace {

const OpencvPictures& opencv_pictures() {
  static const OpencvPictures& pictures = []() -> const OpencvPictures& {
    const auto make = reinterpret_cast<const void* (*)()>(
        on_demand_function("diorama_opencv_pictures", "diorama_opencv_pictures"));
    return *static_cast<const OpencvPictures*>(make());
  }();
  return pictures;
}

/// What a header says, and the memory that decoding takes by it: OpenCV's picture, ours and what
/// lies between.
struct Declared {
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  std::uint64_t needed = 0;
};

class HeaderBytes {
 public:
  HeaderBytes(const Source& source, const char* format, std::endian order)
      : source_(source), format_(format), order_(order) {}

  [[noreturn]] void refuse(const std::string& reason) const {
    source_.refuse(std::string("damaged ") + format_ + ": " + reason);
  }
  std::uint32_t u8(std::uint64_t at) const {
    if (at >= source_.bytes.size()) refuse("the file is cut off");
    return std::uint32_t(source_.bytes[at]);
  }
  std::uint32_t u16(std::uint64_t at) const {
    const bool is_little = order_ == std::endian::little;
    return is_little ? u8(at) | u8(at + 1) << 8 : u8(at) << 8 | u8(at + 1);
  }
  std::uint32_t u32(std::uint64_t at) const {
    const bool is_little = order_ == std::endian::little;
    return is_little ? u16(at) | u16(at + 2) << 16 : u16(at) << 16 | u16(at + 2);
  }
  bool has(std::uint64_t at, std::string_view mark) const {
    for (std::size_t i = 0; i < mark.size(); ++i) {
      if (u8(at + i) != static_cast<unsigned char>(mark[i])) return false;
    }
    return true;
  }

 private:
  const Source& source_;
  const char* format_;
  std::endian order_;
};

/// Of the first page (TIFF 6.0, section 2).
Declared declared_by_tiff(const Source& source) {
  const bool is_little = source.bytes[0] == std::byte('I');
  const HeaderBytes header(source, "TIFF", is_little ? std::endian::little : std::endian::big);
  constexpr std::uint32_t kShort = 3;
  const std::uint64_t directory = header.u32(4);
  const std::uint64_t entries = header.u16(directory);
  Declared declared;
  std::uint64_t bits = 1;
  std::uint64_t samples = 1;
  bool is_palette = false;
  std::uint64_t part_width = 0;
  std::uint64_t part_height = 0;
  for (std::uint64_t i = 0; i < entries; ++i) {
    const std::uint64_t at = directory + 2 + 12 * i;
    const bool is_short = header.u16(at + 2) == kShort;
    const std::uint64_t value = is_short ? header.u16(at + 8) : header.u32(at + 8);
    switch (header.u16(at)) {
      case 256:
        declared.width = value;
        break;
      case 257:
        declared.height = value;
        break;
      case 258:  // one for each sample; more than two stand elsewhere
        bits = is_short && header.u32(at + 4) > 2 ? header.u16(header.u32(at + 8)) : value;
        break;
      case 262:
        is_palette = value == 3;
        break;
      case 277:
        samples = value;
        break;
      case 278:
      case 323:
        part_height = value;
        break;
      case 322:
        part_width = value;
        break;
      default:
        break;
    }
  }
  if (declared.width == 0 || declared.height == 0) header.refuse("it does not say its size");
  source.check_size(declared.width, declared.height);
  if (samples < 1 || samples > 4 || bits > 64) {
    header.refuse("pixels of " + std::to_string(samples) + " samples with " + std::to_string(bits) +
                  " bits are not read");
  }
  const std::uint64_t stored = std::max<std::uint64_t>(1, bits / 8);
  const std::uint64_t kept = stored == 1 ? 1 : 4;
  // Strips end with the picture, tiles do not.
  if (part_width == 0) part_height = std::min(part_height, declared.height);
  if (part_height == 0) part_height = declared.height;
  if (part_width == 0) part_width = declared.width;
  constexpr std::uint64_t kMostPart = std::uint64_t(1) << 20;
  if (part_width > kMostPart || part_height > kMostPart) header.refuse("its tiles are too large");
  if (is_palette) samples = std::max<std::uint64_t>(samples, 3);
  declared.needed = declared.width * declared.height * samples * (stored + kept) +
                    part_width * part_height * std::max<std::uint64_t>(4, samples * stored);
  return declared;
}

/// Of the container's canvas, or its only picture (RFC 9649).
Declared declared_by_webp(const Source& source) {
  const HeaderBytes header(source, "WebP", std::endian::little);
  const auto u24 = [&](std::uint64_t at) { return header.u16(at) | header.u8(at + 2) << 16; };
  Declared declared;
  if (header.has(12, "VP8X")) {
    declared.width = u24(24) + 1;
    declared.height = u24(27) + 1;
  } else if (header.has(12, "VP8L")) {
    const std::uint32_t sizes = header.u32(21);
    declared.width = (sizes & 0x3FFF) + 1;
    declared.height = (sizes >> 14 & 0x3FFF) + 1;
  } else if (header.has(12, "VP8 ")) {
    declared.width = header.u16(26) & 0x3FFF;
    declared.height = header.u16(28) & 0x3FFF;
  } else {
    header.refuse("it holds no picture");
  }
  constexpr std::uint64_t kPerPixel = 12;  // four bytes each: the decoder's, OpenCV's, ours
  declared.needed = declared.width * declared.height * kPerPixel;
  return declared;
}

/// Of the code stream (ISO/IEC 15444-1, A.5.1), alone or in the boxes of a JP2 file.
Declared declared_by_jpeg_2000(const Source& source) {
  const HeaderBytes header(source, "JPEG 2000", std::endian::big);
  std::uint64_t stream = 0;
  if (header.u32(0) != 0xFF4FFF51) {
    while (!header.has(stream + 4, "jp2c")) {
      const std::uint32_t size = header.u32(stream);
      // 0 reaches to the end, 1 has a size of 64 bits behind it: neither stands before the stream.
      if (size < 8) header.refuse("it holds no code stream");
      stream += size;
    }
    stream += header.u32(stream) == 1 ? 16 : 8;
    if (header.u32(stream) != 0xFF4FFF51) header.refuse("its code stream has no sizes");
  }
  const auto extent = [&](std::uint64_t at) {
    const std::uint64_t end = header.u32(stream + at);
    const std::uint64_t begin = header.u32(stream + at + 8);
    return end > begin ? end - begin : 0;
  };
  Declared declared{extent(8), extent(12), 0};
  source.check_size(declared.width, declared.height);
  const std::uint64_t components = header.u16(stream + 40);
  constexpr std::uint64_t kPerSample = 14;  // two of 32 bits in the decoder, OpenCV's 16, our float
  declared.needed = declared.width * declared.height * components * kPerSample;
  return declared;
}

Texture decode(const Source& source, const Declared& declared, const char* format) {
  source.check_size(declared.width, declared.height);
  source.check_budget(declared.width, declared.height, declared.needed);
  const OpencvPictures& pictures = opencv_pictures();
  try {
    Texture texture = pictures.decode(source.bytes);
    if (std::uint64_t(texture.width) == declared.width &&
        std::uint64_t(texture.height) == declared.height) {
      return texture;
    }
  } catch (const std::runtime_error& error) {
    source.refuse(std::string("damaged ") + format + ": " + error.what());
  }
  source.refuse(std::string("damaged ") + format +
                ": its header says another size than its pixels");
}

}  // namespace

Texture decode_tiff(const Source& source) {
  return decode(source, declared_by_tiff(source), "TIFF");
}

Texture decode_webp(const Source& source) {
  return decode(source, declared_by_webp(source), "WebP");
}

Texture decode_jpeg_2000(const Source& source) {
  return decode(source, declared_by_jpeg_2000(source), "JPEG 2000");
}

}  // namespace diorama::images
