// SPDX-License-Identifier: Apache-2.0
#include <libdeflate.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "framework/images/codecs.h"
#include "framework/images/idle_objects.h"
#include "framework/images/png_filters.h"

// PNG (ISO/IEC 15948). The time goes into deflate, and libdeflate is several times as fast as zlib:
// writing is done here, and so is reading of the plain files that nearly all are. Whatever else
// there is, and whatever is wrong with a file, is libpng's.
namespace diorama::images {
namespace {

/// State of one read. libpng reports errors by longjmp, so nothing with a destructor may live in
/// the functions that call it.
struct PngRead {
  const std::byte* at = nullptr;
  std::size_t left = 0;
  std::jmp_buf failed;
  char message[128] = {};
};

void on_read(png_structp png, png_bytep to, png_size_t size) {
  auto* read = static_cast<PngRead*>(png_get_io_ptr(png));
  if (size > read->left) png_error(png, "the file is cut off");
  std::memcpy(to, read->at, size);
  read->at += size;
  read->left -= size;
}

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  auto* read = static_cast<PngRead*>(png_get_error_ptr(png));
  std::strncpy(read->message, message, sizeof read->message - 1);
  std::longjmp(read->failed, 1);
}

void on_warning(png_structp, png_const_charp) {}

struct PngHeader {
  png_uint_32 width = 0;
  png_uint_32 height = 0;
  int channels = 0;  // after conversion
  int bits = 0;      // 8 or 16, after conversion
  bool is_interlaced = false;
  std::uint64_t coded_row_bits = 0;
};

/// Reads up to the pixels. libpng allocates nothing by the header's sizes here.
bool read_header(png_structp png, png_infop info, PngRead& read, PngHeader& header) {
  if (setjmp(read.failed)) return false;
  png_set_user_limits(png, 0x7fffffff, 0x7fffffff);  // our own check has the better message
  // Texts, profiles and what else may be packed a thousandfold is of no use here.
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_read_info(png, info);
  header.width = png_get_image_width(png, info);
  header.height = png_get_image_height(png, info);
  header.is_interlaced = png_get_interlace_type(png, info) != PNG_INTERLACE_NONE;
  const int bits = png_get_bit_depth(png, info);
  const int channels = png_get_channels(png, info);
  header.coded_row_bits =
      std::uint64_t(header.width) * std::uint64_t(bits) * std::uint64_t(channels);
  header.bits = bits == 16 ? 16 : 8;
  header.channels = (png_get_color_type(png, info) == PNG_COLOR_TYPE_PALETTE ? 3 : channels) +
                    (png_get_valid(png, info, PNG_INFO_tRNS) ? 1 : 0);
  return true;
}

/// Asks for 8 or 16 bits per channel without palette. False also when libpng converts otherwise.
bool start_rows(png_structp png, png_infop info, PngRead& read, const PngHeader& header) {
  if (setjmp(read.failed)) return false;
  png_set_expand(png);
  if (header.bits == 16) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_channels(png, info) == header.channels &&
      png_get_bit_depth(png, info) == header.bits) {
    return true;
  }
  std::strcpy(read.message, "its pixels are of an unknown kind");
  return false;
}

bool read_row(png_structp png, png_bytep row, PngRead& read) {
  if (setjmp(read.failed)) return false;
  png_read_row(png, row, nullptr);
  return true;
}

bool read_all_rows(png_structp png, png_bytepp rows, PngRead& read) {
  if (setjmp(read.failed)) return false;
  png_read_image(png, rows);
  return true;
}

bool read_end(png_structp png, PngRead& read) {
  if (setjmp(read.failed)) return false;
  png_read_end(png, nullptr);
  return true;
}

/// Owns libpng's structs.
class PngReader {
 public:
  PngReader(PngRead& read)
      : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &read, on_error, on_warning)),
        info_(png_ ? png_create_info_struct(png_) : nullptr) {
    if (!info_) throw std::bad_alloc();
    png_set_read_fn(png_, &read, on_read);
    png_set_crc_action(png_, PNG_CRC_ERROR_QUIT, PNG_CRC_WARN_DISCARD);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  png_structp png() { return png_; }
  png_infop info() { return info_; }

 private:
  png_structp png_;
  png_infop info_;
};

// --- reading what is plain ---

constexpr std::array<std::uint8_t, 8> kMark{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

/// Larger pictures go row by row, and are in memory as far as the file goes.
constexpr std::uint64_t kMostAtOnce = std::uint64_t(32) << 20;

std::uint32_t get_u32(const std::uint8_t* from) {
  return std::uint32_t(from[0]) << 24 | std::uint32_t(from[1]) << 16 | std::uint32_t(from[2]) << 8 |
         std::uint32_t(from[3]);
}

struct PlainPng {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int channels = 0;
  std::vector<std::uint8_t> joined;  ///< Behind `packed`, where that comes in parts.
  std::span<const std::uint8_t> packed;
};

/// Nothing but eight bits without palette or colour for transparency, row by row, in chunks that
/// follow the standard and are not damaged.
std::optional<PlainPng> plain_png(std::span<const std::uint8_t> file) {
  struct Chunk {
    std::string_view type;
    std::span<const std::uint8_t> data;
  };
  std::size_t at = kMark.size();
  const auto next_chunk = [&]() -> std::optional<Chunk> {
    if (file.size() - at < 12) return std::nullopt;
    const std::uint32_t size = get_u32(&file[at]);
    if (size > file.size() - at - 12) return std::nullopt;
    const std::uint8_t* type = &file[at + 4];
    at += 12 + std::size_t(size);
    if (libdeflate_crc32(0, type, 4 + std::size_t(size)) != get_u32(type + 4 + size)) {
      return std::nullopt;
    }
    return Chunk{{reinterpret_cast<const char*>(type), 4}, {type + 4, size}};
  };

  const auto header = next_chunk();
  if (!header || header->type != "IHDR" || header->data.size() != 13) return std::nullopt;
  PlainPng png{get_u32(&header->data[0]), get_u32(&header->data[4]), 0, {}, {}};
  constexpr std::array<int, 7> kChannels{1, 0, 3, 0, 2, 0, 4};  // by type of colour
  const std::uint8_t colors = header->data[9];
  png.channels = colors < kChannels.size() ? kChannels[colors] : 0;
  const bool is_plain = header->data[8] == 8 && png.channels > 0 && header->data[10] == 0 &&
                        header->data[11] == 0 && header->data[12] == 0;
  if (!is_plain) return std::nullopt;

  bool has_ended = false;  // the run of IDAT, which is one
  for (auto chunk = next_chunk(); chunk; chunk = next_chunk()) {
    if (chunk->type == "IEND") {
      if (!chunk->data.empty() || png.packed.empty()) return std::nullopt;
      return png;
    }
    if (chunk->type == "IDAT") {
      if (has_ended) return std::nullopt;
      if (png.packed.empty()) {
        png.packed = chunk->data;
        continue;
      }
      if (png.joined.empty()) png.joined.assign(png.packed.begin(), png.packed.end());
      png.joined.insert(png.joined.end(), chunk->data.begin(), chunk->data.end());
      png.packed = png.joined;
      continue;
    }
    has_ended = !png.packed.empty();
    // Texts, times, profiles and the like have a small first letter, and no part in the pixels.
    const bool is_critical = (chunk->type[0] & 0x20) == 0;
    if (is_critical || chunk->type == "tRNS") return std::nullopt;
  }
  return std::nullopt;
}

/// What a picture is decoded with, kept for the next: memory that is taken anew is cleared,
/// and then far from the processor.
class Inflater {
 public:
  /// Exactly `size` bytes, valid until the next call; empty for a damaged stream.
  std::span<const std::uint8_t> inflate(std::span<const std::uint8_t> packed, std::size_t size) {
    if (!inflater_) inflater_.reset(libdeflate_alloc_decompressor());
    if (!inflater_) throw std::bad_alloc();
    if (size > size_) {
      bytes_ = std::make_unique_for_overwrite<std::uint8_t[]>(size);
      size_ = size;
    }
    // Without a place for the size there must be exactly so much.
    const auto result = libdeflate_zlib_decompress(inflater_.get(), packed.data(), packed.size(),
                                                   bytes_.get(), size, nullptr);
    if (result != LIBDEFLATE_SUCCESS) return {};
    return {bytes_.get(), size};
  }
  /// Gives back what only a large picture needed.
  void shrink() {
    if (size_ <= kMostKept) return;
    bytes_.reset();
    size_ = 0;
  }

 private:
  static constexpr std::size_t kMostKept = std::size_t(8) << 20;
  std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflater_{
      nullptr, libdeflate_free_decompressor};
  std::unique_ptr<std::uint8_t[]> bytes_;
  std::size_t size_ = 0;
};

/// Nothing where libpng has to look, be it that the file is damaged.
std::optional<Texture> decode_plain(const Source& source) {
  const auto png =
      plain_png({reinterpret_cast<const std::uint8_t*>(source.bytes.data()), source.bytes.size()});
  if (!png || png->width == 0 || png->height == 0 || png->width > kMaxSide ||
      png->height > kMaxSide) {
    return std::nullopt;
  }
  const std::uint64_t row_size = std::uint64_t(png->width) * std::uint64_t(png->channels);
  const std::uint64_t size = row_size * png->height;
  const std::uint64_t filtered_size = size + png->height;
  // Deflate makes at most 1032 bytes of one.
  if (size > kMostAtOnce || filtered_size + size + png->joined.size() > source.budget ||
      filtered_size / 1032 > png->packed.size()) {
    return std::nullopt;
  }
  static IdleObjects<Inflater> inflaters;
  IdleObjects<Inflater>::Lease inflater(inflaters);
  const auto rows = inflater->inflate(png->packed, std::size_t(filtered_size));
  Texture texture;
  texture.width = int(png->width);
  texture.height = int(png->height);
  texture.channels = png->channels;
  const bool is_good = !rows.empty() && undo_png_filters(rows, png->height,
                                                         std::size_t(png->channels), texture.bytes);
  inflater->shrink();
  if (!is_good) return std::nullopt;
  return texture;
}

// --- writing ---

using Row = std::vector<std::uint8_t>;

/// Whichever of the three is nearest to left + up - corner, of equally near ones the first
/// (PNG 9.4). Without branches and in eight bits, so that compilers make vectors of it.
std::uint8_t paeth(std::uint8_t left, std::uint8_t up, std::uint8_t corner) {
  const std::uint8_t low = std::min(left, up);
  const std::uint8_t high = std::max(left, up);
  // The corner may lie outside; the side across from it is nearest then.
  const auto to_low = std::uint8_t(std::max(high, corner) - corner);
  const auto to_high = std::uint8_t(corner - std::min(corner, low));
  const std::uint8_t to_side = std::min(to_low, to_high);
  const auto to_corner = std::uint8_t(std::max(to_low, to_high) - to_side);
  const std::uint8_t side = to_low < to_high ? low : high;
  return to_side <= to_corner ? side : corner;
}

/// The filters that are tried: none, left, up, Paeth. The average of left and up is hardly ever the
/// best.
constexpr std::array<int, 4> kFilters{0, 1, 2, 4};

/// Filters a row (PNG 9.2); `stride` bytes lie between a pixel and its left neighbour. `above` has
/// the length of `row`.
void apply_filter(int filter, const std::uint8_t* row, const std::uint8_t* above, std::size_t size,
                  std::size_t stride, std::uint8_t* out) {
  const std::size_t head = std::min(stride, size);
  switch (filter) {
    case 0:
      std::copy(row, row + size, out);
      return;
    case 1:
      std::copy(row, row + head, out);
      for (std::size_t i = head; i < size; ++i) out[i] = std::uint8_t(row[i] - row[i - stride]);
      return;
    case 2:
      for (std::size_t i = 0; i < size; ++i) out[i] = std::uint8_t(row[i] - above[i]);
      return;
    default:
      for (std::size_t i = 0; i < head; ++i) out[i] = std::uint8_t(row[i] - above[i]);
      for (std::size_t i = head; i < size; ++i) {
        out[i] = std::uint8_t(row[i] - paeth(row[i - stride], above[i], above[i - stride]));
      }
  }
}

/// How well a filtered row is likely to compress: the sum of its bytes taken as signed numbers.
std::uint64_t cost_of(const Row& row) {
  const auto size_of = [](std::uint8_t byte) { return std::min(byte, std::uint8_t(0u - byte)); };
  std::uint64_t sum = 0;
  // Parts whose sums fit into 16 bits, which compilers make vectors of.
  constexpr std::size_t kPart = 496;
  std::size_t i = 0;
  for (; i + kPart <= row.size(); i += kPart) {
    std::uint16_t part = 0;
    for (std::size_t k = i; k < i + kPart; ++k) part = std::uint16_t(part + size_of(row[k]));
    sum += part;
  }
  for (; i < row.size(); ++i) sum += size_of(row[i]);
  return sum;
}

/// What a picture is encoded with, kept for the next as an Inflater is.
class Deflater {
 public:
  /// The stream of all rows, each behind the number of the filter that suits it best; valid until
  /// the next call.
  std::span<const std::uint8_t> deflate(const ImageView& image) {
    // Level 1: rendered pictures get a twentieth larger than at level 3, in half the time.
    if (!deflater_) deflater_.reset(libdeflate_alloc_compressor(1));
    if (!deflater_) throw std::bad_alloc();
    const std::size_t stride = std::size_t(image.channels * image.bits_per_channel / 8);
    const std::size_t row_size = std::size_t(image.width) * stride;
    const std::size_t size = (row_size + 1) * std::size_t(image.height);
    const std::size_t bound = libdeflate_zlib_compress_bound(deflater_.get(), size);
    if (size + bound > size_) {
      bytes_ = std::make_unique_for_overwrite<std::uint8_t[]>(size + bound);
      size_ = size + bound;
    }
    filter_rows(image, stride, row_size, bytes_.get());
    std::uint8_t* const packed = bytes_.get() + size;
    return {packed, libdeflate_zlib_compress(deflater_.get(), bytes_.get(), size, packed, bound)};
  }
  /// Gives back what only a large picture needed.
  void shrink() {
    if (size_ <= kMostKept) return;
    bytes_.reset();
    size_ = 0;
  }

 private:
  static void filter_rows(const ImageView& image, std::size_t stride, std::size_t size,
                          std::uint8_t* out);

  static constexpr std::size_t kMostKept = std::size_t(8) << 20;
  std::unique_ptr<libdeflate_compressor, void (*)(libdeflate_compressor*)> deflater_{
      nullptr, libdeflate_free_compressor};
  std::unique_ptr<std::uint8_t[]> bytes_;
  std::size_t size_ = 0;
};

void Deflater::filter_rows(const ImageView& image, std::size_t stride, std::size_t size,
                           std::uint8_t* out) {
  const bool is_swapped =
      image.bits_per_channel == 16 && std::endian::native == std::endian::little;
  std::array<Row, 2> swapped;
  if (is_swapped) swapped.fill(Row(size));
  const Row nothing(size, 0);
  const std::uint8_t* above = nothing.data();
  std::array<Row, kFilters.size()> tries;
  tries.fill(Row(size));
  for (int y = 0; y < image.height; ++y) {
    const auto* row = static_cast<const std::uint8_t*>(image.data) + std::size_t(y) * size;
    if (is_swapped) {
      Row& own = swapped[std::size_t(y % 2)];
      for (std::size_t i = 0; i + 1 < size; i += 2) {
        own[i] = row[i + 1];
        own[i + 1] = row[i];
      }
      row = own.data();
    }
    std::size_t best = 0;
    std::uint64_t best_cost = 0;
    for (std::size_t i = 0; i < kFilters.size(); ++i) {
      apply_filter(kFilters[i], row, above, size, stride, tries[i].data());
      const std::uint64_t cost = cost_of(tries[i]);
      if (i > 0 && cost >= best_cost) continue;
      best = i;
      best_cost = cost;
      if (cost == 0) break;  // as all later rows of a surface with one value
    }
    *out++ = std::uint8_t(kFilters[best]);
    out = std::copy(tries[best].begin(), tries[best].end(), out);
    above = row;
  }
}

void put_u32(std::uint8_t* to, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) to[i] = std::uint8_t(value >> (24 - 8 * i));
}

void put_chunk(std::vector<std::byte>& file, const char* type, std::span<const std::uint8_t> data) {
  std::array<std::uint8_t, 8> head;
  put_u32(head.data(), std::uint32_t(data.size()));
  std::memcpy(head.data() + 4, type, 4);
  std::uint32_t crc = libdeflate_crc32(0, head.data() + 4, 4);
  // With a null pointer libdeflate starts anew.
  if (!data.empty()) crc = libdeflate_crc32(crc, data.data(), data.size());
  std::array<std::uint8_t, 4> tail;
  put_u32(tail.data(), crc);
  const auto append = [&file](const std::uint8_t* bytes, std::size_t size) {
    const auto* begin = reinterpret_cast<const std::byte*>(bytes);
    file.insert(file.end(), begin, begin + size);
  };
  append(head.data(), head.size());
  append(data.data(), data.size());
  append(tail.data(), tail.size());
}

}  // namespace

Texture decode_png(const Source& source) {
  if (auto texture = decode_plain(source)) return std::move(*texture);
  PngRead read;
  read.at = source.bytes.data();
  read.left = source.bytes.size();
  PngReader reader(read);
  PngHeader header;
  const auto require = [&](bool is_good) {
    if (!is_good) source.refuse(std::string("damaged PNG: ") + read.message);
  };
  require(read_header(reader.png(), reader.info(), read, header));
  source.check_size(header.width, header.height);
  // Deflate makes at most 1032 bytes of one.
  if (header.coded_row_bits / 8 * header.height / 1032 > source.bytes.size()) {
    source.refuse("damaged PNG: the file is cut off");
  }
  const bool is_deep = header.bits == 16;
  const std::size_t row_samples = std::size_t(header.width) * std::size_t(header.channels);
  const std::uint64_t samples = std::uint64_t(row_samples) * header.height;
  const std::uint64_t raw = samples * (is_deep ? 2 : 1);
  source.check_budget(header.width, header.height,
                      samples * (is_deep ? 4 : 1) + (header.is_interlaced && is_deep ? raw : 0) +
                          header.height * sizeof(png_bytep));
  require(start_rows(reader.png(), reader.info(), read, header));

  Texture texture;
  texture.width = int(header.width);
  texture.height = int(header.height);
  texture.channels = header.channels;
  const std::size_t row_size = row_samples * (is_deep ? 2 : 1);
  GrowingRows<std::uint8_t> bytes(row_size, is_deep && !header.is_interlaced ? 1 : header.height);
  GrowingRows<float> floats(row_samples, is_deep ? header.height : 0);
  const auto add_deep_row = [&](const std::uint8_t* from) {
    float* to = floats.add();
    for (std::size_t i = 0; i < row_samples; ++i) {
      std::uint16_t value;
      std::memcpy(&value, from + 2 * i, 2);
      to[i] = float(value) / 65535.0f;
    }
  };
  if (header.is_interlaced) {
    std::uint8_t* pixels = bytes.add(header.height);
    std::vector<png_bytep> rows(header.height);
    for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = pixels + y * row_size;
    require(read_all_rows(reader.png(), rows.data(), read));
    for (std::size_t y = 0; is_deep && y < rows.size(); ++y) add_deep_row(rows[y]);
  } else if (is_deep) {
    std::uint8_t* row = bytes.add();
    for (png_uint_32 y = 0; y < header.height; ++y) {
      require(read_row(reader.png(), row, read));
      add_deep_row(row);
    }
  } else {
    for (png_uint_32 y = 0; y < header.height; ++y) {
      require(read_row(reader.png(), bytes.add(), read));
    }
  }
  require(read_end(reader.png(), read));
  if (is_deep) {
    texture.floats = floats.take();
  } else {
    texture.bytes = bytes.take();
  }
  return texture;
}

std::vector<std::byte> encode_png(const ImageView& image) {
  constexpr std::array<std::uint8_t, 5> kColorType{0, 0, 0, 2, 6};  // by channels
  std::array<std::uint8_t, 13> header{};
  put_u32(header.data(), std::uint32_t(image.width));
  put_u32(header.data() + 4, std::uint32_t(image.height));
  header[8] = std::uint8_t(image.bits_per_channel);
  header[9] = kColorType[std::size_t(image.channels)];

  static IdleObjects<Deflater> deflaters;
  IdleObjects<Deflater>::Lease deflater(deflaters);
  const std::span<const std::uint8_t> packed = deflater->deflate(image);
  constexpr std::size_t kAroundChunk = 12;
  std::vector<std::byte> file;
  file.reserve(kMark.size() + header.size() + packed.size() + 3 * kAroundChunk);
  for (const std::uint8_t byte : kMark) file.push_back(std::byte(byte));
  put_chunk(file, "IHDR", header);
  put_chunk(file, "IDAT", packed);
  put_chunk(file, "IEND", {});
  deflater->shrink();
  return file;
}

}  // namespace diorama::images
