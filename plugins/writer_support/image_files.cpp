// SPDX-License-Identifier: Apache-2.0
#include "writer_support/image_files.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr std::size_t kPngSignature = 8;
constexpr std::size_t kPngHeaderChunk = 4 + 4 + 13 + 4;  ///< Length, "IHDR", content, checksum.

/// The CRC of PNG's chunks (ISO/IEC 15948, annex D).
std::uint32_t png_crc(std::span<const std::byte> bytes) {
  std::uint32_t crc = 0xFFFFFFFFu;
  for (const std::byte byte : bytes) {
    crc ^= std::uint32_t(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

void put_big_endian(std::uint32_t value, std::byte* to) {
  for (int i = 0; i < 4; ++i) to[i] = std::byte((value >> (24 - 8 * i)) & 0xFFu);
}

/// Sets the checksum of the chunk that begins there.
void seal(std::span<std::byte> chunk) {
  const std::size_t content = chunk.size() - 4;
  put_big_endian(png_crc(chunk.subspan(4, content - 4)), &chunk[content]);
}

}  // namespace

std::vector<std::uint8_t> without_alpha(const Image<Rgba8>& image) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(image.pixels().size() * 3);
  for (const Rgba8& pixel : image.pixels()) rgb.insert(rgb.end(), pixel.begin(), pixel.begin() + 3);
  return rgb;
}

std::vector<std::byte> png_file(const Host& host, const Image<Rgba8>& image) {
  return host.encode_image({image.pixels().data(), image.width(), image.height(), 4, 8},
                           ImageFormat::Png);
}

std::vector<std::byte> png_file(const Host& host, int width, int height,
                                std::span<const std::uint8_t> gray) {
  return host.encode_image({gray.data(), width, height, 1, 8}, ImageFormat::Png);
}

// Gray and indexed pictures of 8 bits differ in the header's type of colour and the palette behind
// it; their pixels are coded alike.
std::vector<std::byte> indexed_png_file(const Host& host, int width, int height,
                                        std::span<const std::uint8_t> indices,
                                        std::span<const std::array<std::uint8_t, 3>> palette) {
  std::vector<std::byte> png = png_file(host, width, height, indices);
  constexpr std::size_t kColorType = kPngSignature + 8 + 9;
  constexpr std::byte kIndexed{3};
  if (png.size() < kPngSignature + kPngHeaderChunk || png[kColorType] != std::byte(0)) {
    throw Error(ErrorKind::Internal, "png: the host's gray picture is none");
  }
  png[kColorType] = kIndexed;
  seal(std::span(png).subspan(kPngSignature, kPngHeaderChunk));
  std::vector<std::byte> chunk(8 + 3 * palette.size() + 4);
  put_big_endian(std::uint32_t(3 * palette.size()), chunk.data());
  constexpr std::string_view kName = "PLTE";
  std::memcpy(&chunk[4], kName.data(), kName.size());
  std::memcpy(&chunk[8], palette.data(), 3 * palette.size());
  seal(chunk);
  png.insert(png.begin() + kPngSignature + kPngHeaderChunk, chunk.begin(), chunk.end());
  return png;
}

std::vector<std::byte> png_file(const Host& host, const Image<std::uint32_t>& image,
                                const std::string& what) {
  std::vector<std::uint16_t> gray(image.pixels().size());
  for (std::size_t i = 0; i < gray.size(); ++i) {
    const std::uint32_t value = image.pixels()[i];
    if (value > 0xFFFF) {
      throw Error(ErrorKind::Output, what + ": the value " + std::to_string(value) +
                                         " does not fit into a 16-bit picture (0 to 65535)");
    }
    gray[i] = std::uint16_t(value);
  }
  return host.encode_image({gray.data(), image.width(), image.height(), 1, 16}, ImageFormat::Png);
}

std::vector<std::byte> rgb_png_file(const Host& host, const Image<Rgba8>& image) {
  const std::vector<std::uint8_t> rgb = without_alpha(image);
  return host.encode_image({rgb.data(), image.width(), image.height(), 3, 8}, ImageFormat::Png);
}

std::vector<std::byte> jpeg_file(const Host& host, const Image<Rgba8>& image) {
  const std::vector<std::uint8_t> rgb = without_alpha(image);
  return host.encode_image({rgb.data(), image.width(), image.height(), 3, 8}, ImageFormat::Jpeg);
}

std::vector<std::byte> exr_file(const Host& host, const Image<Vec3f>& image) {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  return host.encode_image({image.pixels().data(), image.width(), image.height(), 3, 32},
                           ImageFormat::Exr);
}

Image<Rgba8> normals_picture(const Image<Vec3f>& normals) {
  const auto byte = [](float n) {
    return std::uint8_t(std::clamp((n * 0.5f + 0.5f) * 255.0f, 0.0f, 255.0f));
  };
  Image<Rgba8> picture(normals.width(), normals.height(), Rgba8{});
  for (std::size_t i = 0; i < normals.pixels().size(); ++i) {
    const Vec3f& n = normals.pixels()[i];
    const float w = n.isZero(0.0f) ? 0.0f : 1.0f;
    picture.pixels()[i] = {byte(n.x()), byte(n.y()), byte(n.z()), byte(w)};
  }
  return picture;
}

std::vector<std::uint8_t> distance_picture(const Image<float>& distances) {
  float near = std::numeric_limits<float>::infinity();
  float far = -std::numeric_limits<float>::infinity();
  for (const float d : distances.pixels()) {
    if (!std::isfinite(d)) continue;
    near = std::min(near, d);
    far = std::max(far, d);
  }
  std::vector<std::uint8_t> gray(distances.pixels().size(), 0);
  if (!(near > 0.0f) || !(far > near)) return gray;
  const float log_near = std::log(near);
  const float log_range = std::log(far) - log_near;
  for (std::size_t i = 0; i < gray.size(); ++i) {
    const float d = distances.pixels()[i];
    if (std::isnan(d)) continue;
    const float value = 1.0f - (std::log(std::clamp(d, near, far) + 1e-5f) - log_near) / log_range;
    gray[i] = std::uint8_t(std::max(0.0f, 255.0f * value));
  }
  return gray;
}

}  // namespace diorama
