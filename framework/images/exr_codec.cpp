// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfTileDescription.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>
#include <utility>

#include "framework/images/codecs.h"

// OpenEXR through memory. Its own thread pool stays off: the host's threads call in here.
namespace diorama::images {
namespace {

using Names = std::vector<std::string>;

class MemoryReader final : public Imf::IStream {
 public:
  explicit MemoryReader(const Source& source)
      : IStream(std::string(source.name).c_str()), bytes_(source.bytes) {}

  bool read(char c[], int n) override {
    if (n < 0 || std::uint64_t(n) > bytes_.size() - at_) {
      throw Iex::InputExc("the file is cut off");
    }
    std::memcpy(c, bytes_.data() + at_, std::size_t(n));
    at_ += std::uint64_t(n);
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t position) override {
    at_ = std::min<std::uint64_t>(position, bytes_.size());
  }

 private:
  std::span<const std::byte> bytes_;
  std::uint64_t at_ = 0;
};

class MemoryWriter final : public Imf::OStream {
 public:
  MemoryWriter() : OStream("memory") {}
  void write(const char c[], int n) override {
    const std::size_t end = at_ + std::size_t(n);
    if (end > bytes_.size()) bytes_.resize(end);
    std::memcpy(bytes_.data() + at_, c, std::size_t(n));
    at_ = end;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = std::size_t(position); }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

/// The channels of a picture in the order of the texture: RGB(A), else grey, else the only one.
Names picture_channels(const Imf::ChannelList& channels, const Source& source) {
  Names all;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    if (channel.channel().xSampling != 1 || channel.channel().ySampling != 1) {
      source.refuse("its channel '" + std::string(channel.name()) +
                    "' is subsampled; save the EXR as RGB");
    }
    all.emplace_back(channel.name());
  }
  const auto has = [&](const char* name) {
    return std::find(all.begin(), all.end(), name) != all.end();
  };
  if (has("R") && has("G") && has("B")) {
    return has("A") ? Names{"R", "G", "B", "A"} : Names{"R", "G", "B"};
  }
  if (has("Y")) return {"Y"};
  if (all.size() == 1) return all;
  std::string found;
  for (const std::string& name : all) found += (found.empty() ? "" : ", ") + name;
  source.refuse("the EXR has no picture channels R, G, B or Y; it has: " + found);
}

Imf::FrameBuffer buffer_for(float* pixels, const Names& names, std::size_t width,
                            const Imath::Box2i& window) {
  const std::size_t x_stride = names.size() * sizeof(float);
  const std::size_t y_stride = x_stride * width;
  // Slice::Make moves the pointer by the window's corner, which need not be at the origin.
  Imf::FrameBuffer buffer;
  for (std::size_t c = 0; c < names.size(); ++c) {
    buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, pixels + c, window, x_stride, y_stride));
  }
  return buffer;
}

/// Lines that are packed together.
std::uint64_t lines_per_chunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
      return 1;
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 32;
  }
}

std::uint64_t sample_size(Imf::PixelType type) { return type == Imf::HALF ? 2 : 4; }

constexpr std::uint64_t kMarkAndVersion = 8;

/// Walks over the attributes: the library takes as much memory as one claims to need before it
/// looks whether the file has that much.
class AttributeWalk {
 public:
  explicit AttributeWalk(const Source& source) : source_(source) {}

  void run() {
    constexpr std::uint32_t kHasParts = 0x1000;
    const bool has_parts = (u32(4) & kHasParts) != 0;
    at_ = kMarkAndVersion;
    // Several headers end with an empty one.
    do {
      while (!skip_word().empty()) {
        const std::string_view type = skip_word();
        const std::uint64_t size = u32(at_);
        at_ += 4;
        if (size > source_.bytes.size() - at_) cut_off();
        const std::uint64_t end = at_ + size;
        check_size_of(type, size);
        at_ = end;
      }
    } while (has_parts && at_ < source_.bytes.size() && source_.bytes[at_] != std::byte(0));
  }

 private:
  [[noreturn]] void cut_off() const { source_.refuse("damaged EXR: the file is cut off"); }

  [[noreturn]] void wrong_size(std::string_view type) const {
    source_.refuse("damaged EXR: an attribute of type " + std::string(type) + " has a wrong size");
  }

  /// The library reads values of types that it knows by their types, and goes on behind them. What
  /// stands there must be the next attribute.
  void check_size_of(std::string_view type, std::uint64_t size) {
    static constexpr std::array<std::pair<std::string_view, std::uint64_t>, 23> kSizes{
        {{"box2f", 16},      {"box2i", 16},   {"chromaticities", 32},
         {"compression", 1}, {"double", 8},   {"envmap", 1},
         {"float", 4},       {"int", 4},      {"keycode", 28},
         {"lineOrder", 1},   {"m33d", 72},    {"m33f", 36},
         {"m44d", 128},      {"m44f", 64},    {"rational", 8},
         {"tiledesc", 9},    {"timecode", 8}, {"v2d", 16},
         {"v2f", 8},         {"v2i", 8},      {"v3d", 24},
         {"v3f", 12},        {"v3i", 12}}};
    for (const auto& [known, expected] : kSizes) {
      if (type == known && size != expected) wrong_size(type);
    }
    // Packed lists of ids are of use in deep files only, and may unpack to anything.
    if (type == "idmanifest" || type == "deepImageState") {
      source_.refuse("deep EXR files are not read; save it flat");
    }
    if (type != "chlist") return;
    constexpr std::uint64_t kAfterName = 16;
    const std::uint64_t end = at_ + size;
    while (!skip_word().empty()) {
      if (at_ > end || kAfterName > end - at_) wrong_size(type);
      at_ += kAfterName;
    }
    if (at_ != end) wrong_size(type);
  }

  std::uint32_t u32(std::uint64_t at) const {
    if (source_.bytes.size() < 4 || at > source_.bytes.size() - 4) cut_off();
    std::uint32_t value = 0;
    for (std::uint64_t i = 0; i < 4; ++i) {
      value |= std::uint32_t(source_.bytes[at + i]) << (8 * i);
    }
    return value;
  }

  std::string_view skip_word() {
    const auto* text = reinterpret_cast<const char*>(source_.bytes.data());
    const std::string_view rest = std::string_view(text, source_.bytes.size()).substr(at_);
    const std::size_t end = rest.find('\0');
    if (end == std::string_view::npos) cut_off();
    at_ += end + 1;
    return rest.substr(0, end);
  }

  const Source& source_;
  std::uint64_t at_ = 0;
};

/// The header alone: opening a file lets the library take memory by what its header says.
Imf::Header read_header(const Source& source) {
  AttributeWalk(source).run();
  MemoryReader stream(source);
  stream.seekg(kMarkAndVersion);
  Imf::Header header;
  int version = 0;
  header.readFrom(stream, version);
  return header;
}

struct Size {
  std::uint64_t width = 0;
  std::uint64_t height = 0;
};

/// Refuses what the file is too short for, and what takes too much memory.
Size check_sizes(const Imf::Header& header, std::uint64_t channels, const Source& source) {
  const Imath::Box2i& window = header.dataWindow();
  const auto side = [](int low, int high) {
    return std::uint64_t(std::max<std::int64_t>(std::int64_t(high) - low + 1, 0));
  };
  const Size size{side(window.min.x, window.max.x), side(window.min.y, window.max.y)};
  source.check_size(size.width, size.height);
  std::uint64_t pixel_size = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    pixel_size += sample_size(channel.channel().type);
  }
  // Deflate makes at most 1032 bytes of one, the others less. DWA drops what is zero.
  const bool is_dwa = header.compression() == Imf::DWAA_COMPRESSION ||
                      header.compression() == Imf::DWAB_COMPRESSION;
  if (!is_dwa && size.width * size.height * pixel_size / 1032 > source.bytes.size()) {
    source.refuse("damaged EXR: the file is cut off");
  }
  std::uint64_t chunk_pixels = size.width * lines_per_chunk(header.compression());
  if (header.hasTileDescription()) {
    const Imf::TileDescription& tiles = header.tileDescription();
    const auto padded = std::max<std::uint64_t>(size.width, tiles.xSize) + tiles.xSize;
    chunk_pixels = padded * std::min<std::uint64_t>(tiles.ySize, 1u << 20);
  }
  // Packed, unpacked and as the decoder has it.
  constexpr std::uint64_t kCopiesOfChunk = 3;
  source.check_budget(size.width, size.height,
                      size.width * size.height * channels * sizeof(float) +
                          kCopiesOfChunk * chunk_pixels * pixel_size);
  return size;
}

Texture read(const Source& source) {
  const Imf::Header header = read_header(source);
  const Names names = picture_channels(header.channels(), source);
  const Size size = check_sizes(header, names.size(), source);
  MemoryReader stream(source);
  Imf::InputFile file(stream, 0);
  const Imath::Box2i window = header.dataWindow();
  if (file.header().dataWindow() != window) source.refuse("damaged EXR: it has two headers");
  const std::size_t row_size = std::size_t(size.width) * names.size();
  GrowingRows<float> rows(row_size, std::size_t(size.height));
  file.setFrameBuffer(buffer_for(rows.begin(), names, std::size_t(size.width), window));
  const int step = int(lines_per_chunk(header.compression()));
  for (int y = window.min.y;;) {
    const int last = window.max.y - y < step ? window.max.y : y + step - 1;
    rows.add(std::size_t(last - y) + 1);
    file.readPixels(y, last);
    if (last == window.max.y) break;
    y = last + 1;
  }
  Texture texture;
  texture.width = int(size.width);
  texture.height = int(size.height);
  texture.channels = int(names.size());
  texture.floats = rows.take();
  return texture;
}

}  // namespace

Texture decode_exr(const Source& source) {
  try {
    return read(source);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    source.refuse(std::string("damaged EXR: ") + error.what());
  }
}

std::vector<std::byte> encode_exr(const ImageView& image) {
  const std::array<Names, 5> kNames{Names{}, {"Y"}, {}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
  const Names& names = kNames[std::size_t(image.channels)];
  Imf::Header header(image.width, image.height, 1.0f, Imath::V2f(0, 0), 1.0f, Imf::INCREASING_Y,
                     Imf::ZIP_COMPRESSION);
  for (const std::string& name : names) header.channels().insert(name, Imf::Channel(Imf::FLOAT));
  MemoryWriter stream;
  {
    Imf::OutputFile file(stream, header, 0);
    auto* pixels = const_cast<float*>(static_cast<const float*>(image.data));
    file.setFrameBuffer(buffer_for(pixels, names, std::size_t(image.width), header.dataWindow()));
    file.writePixels(image.height);
  }
  return stream.take();
}

}  // namespace diorama::images
