// SPDX-License-Identifier: Apache-2.0
#include "framework/images/image_codecs.h"

#include <algorithm>
#include <array>
#include <string>

#include "framework/images/codecs.h"

namespace diorama {
namespace {

bool begins_with(std::span<const std::byte> bytes, std::string_view mark) {
  return bytes.size() >= mark.size() &&
         std::equal(mark.begin(), mark.end(), bytes.begin(),
                    [](char c, std::byte b) { return std::byte(c) == b; });
}

bool ends_with_any_case(std::string_view text, std::string_view ending) {
  return text.size() >= ending.size() &&
         std::equal(ending.begin(), ending.end(), text.end() - std::ptrdiff_t(ending.size()),
                    [](char e, char c) { return e == (c >= 'A' && c <= 'Z' ? char(c + 32) : c); });
}

Texture decode_any(const images::Source& source) {
  if (source.bytes.empty()) source.refuse("the image file is empty");
  if (begins_with(source.bytes, "\x89PNG\r\n\x1a\n")) return images::decode_png(source);
  if (begins_with(source.bytes, "\xff\xd8\xff")) return images::decode_jpeg(source);
  if (begins_with(source.bytes, "#?RADIANCE") || begins_with(source.bytes, "#?RGBE")) {
    return images::decode_hdr(source);
  }
  if (begins_with(source.bytes, "\x76\x2f\x31\x01")) return images::decode_exr(source);
  if (begins_with(source.bytes, "BM")) return images::decode_bmp(source);
  if (begins_with(source.bytes, std::string_view("II*\0", 4)) ||
      begins_with(source.bytes, std::string_view("MM\0*", 4))) {
    return images::decode_tiff(source);
  }
  if (begins_with(source.bytes, "RIFF") &&
      begins_with(source.bytes.subspan(std::min<std::size_t>(source.bytes.size(), 8)), "WEBP")) {
    return images::decode_webp(source);
  }
  if (begins_with(source.bytes, std::string_view("\0\0\0\x0cjP  \r\n\x87\n", 12)) ||
      begins_with(source.bytes, "\xff\x4f\xff\x51")) {
    return images::decode_jpeg_2000(source);
  }
  // TGA has no mark of its own; a member of a package is called "a.usdz[b.tga]".
  const bool is_tga =
      ends_with_any_case(source.name, ".tga") || ends_with_any_case(source.name, ".tga]");
  if (is_tga) return images::decode_tga(source);
  source.refuse(
      "is no image of a known format; PNG, JPEG, Radiance HDR, OpenEXR, TIFF, WebP, JPEG 2000, BMP "
      "and TGA are read");
}

void check(const ImageView& image, std::initializer_list<std::pair<int, int>> known,
           const char* format) {
  const bool has_size = image.data && image.width >= 1 && image.height >= 1 &&
                        image.width <= int(images::kMaxSide) &&
                        image.height <= int(images::kMaxSide);
  const std::pair<int, int> type{image.channels, image.bits_per_channel};
  if (has_size && std::find(known.begin(), known.end(), type) != known.end()) return;
  throw Error(ErrorKind::Internal, std::string(format) + " cannot hold an image of " +
                                       std::to_string(image.width) + " x " +
                                       std::to_string(image.height) + " pixels with " +
                                       std::to_string(image.channels) + " channels of " +
                                       std::to_string(image.bits_per_channel) + " bits");
}

}  // namespace

std::shared_ptr<const Texture> decode_image(std::span<const std::byte> bytes, std::string_view name,
                                            std::uint64_t budget) {
  auto texture = std::make_shared<Texture>(decode_any({bytes, name, budget}));
  texture->name = name;
  texture->color_space =
      !texture->bytes.empty() && texture->channels >= 3 ? ColorSpace::Srgb : ColorSpace::Linear;
  return texture;
}

std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format) {
  switch (format) {
    case ImageFormat::Png:
      check(image, {{1, 8}, {3, 8}, {4, 8}, {1, 16}}, "PNG");
      return images::encode_png(image);
    case ImageFormat::Jpeg:
      check(image, {{1, 8}, {3, 8}}, "JPEG");
      return images::encode_jpeg(image);
    case ImageFormat::Hdr:
      check(image, {{3, 32}}, "Radiance HDR");
      return images::encode_hdr(image);
    case ImageFormat::Exr:
      check(image, {{1, 32}, {3, 32}, {4, 32}}, "OpenEXR");
      return images::encode_exr(image);
  }
  throw Error(ErrorKind::Internal, "unknown image format");
}

}  // namespace diorama
