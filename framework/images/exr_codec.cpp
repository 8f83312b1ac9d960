// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <algorithm>
#include <array>
#include <cstring>

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

Texture read(const Source& source) {
  MemoryReader stream(source);
  Imf::InputFile file(stream, 0);
  const Imath::Box2i window = file.header().dataWindow();
  const auto width = std::int64_t(window.max.x) - window.min.x + 1;
  const auto height = std::int64_t(window.max.y) - window.min.y + 1;
  source.check_size(std::uint64_t(std::max<std::int64_t>(width, 0)),
                    std::uint64_t(std::max<std::int64_t>(height, 0)));
  const Names names = picture_channels(file.header().channels(), source);
  Texture texture;
  texture.width = int(width);
  texture.height = int(height);
  texture.channels = int(names.size());
  texture.floats.resize(std::size_t(width * height) * names.size());
  file.setFrameBuffer(buffer_for(texture.floats.data(), names, std::size_t(width), window));
  file.readPixels(window.min.y, window.max.y);
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
