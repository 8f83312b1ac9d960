// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "framework/images/codecs.h"

#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_BMP
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_HDR
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

// BMP and TGA, which only old assets use, by stb_image.
namespace diorama::images {
namespace {

Texture decode(const Source& source, const char* format) {
  if (source.bytes.size() > 0x7fffffff) source.refuse("the image is larger than 2 GiB");
  const auto* bytes = reinterpret_cast<const stbi_uc*>(source.bytes.data());
  const int size = int(source.bytes.size());
  int width = 0;
  int height = 0;
  int channels = 0;
  const auto refuse = [&] {
    source.refuse("damaged " + std::string(format) + ": " + stbi_failure_reason());
  };
  if (!stbi_info_from_memory(bytes, size, &width, &height, &channels)) refuse();
  source.check_size(std::uint64_t(width), std::uint64_t(height));
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(bytes, size, &width, &height, &channels, 0), stbi_image_free);
  if (!pixels) refuse();
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.channels = channels;
  texture.bytes.assign(pixels.get(), pixels.get() + std::size_t(width) * std::size_t(height) *
                                                        std::size_t(channels));
  return texture;
}

}  // namespace

Texture decode_bmp(const Source& source) { return decode(source, "BMP"); }
Texture decode_tga(const Source& source) { return decode(source, "TGA"); }

}  // namespace diorama::images
