// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/error.h"
#include "diorama/host.h"
#include "diorama/material.h"

/// One reader and one writer per format; image_codecs.h chooses among them. Readers throw
/// Error(Asset) beginning with `name`. Writers get views that were checked.
namespace diorama::images {

inline constexpr std::uint32_t kMaxSide = 16384;

struct Source {
  std::span<const std::byte> bytes;
  std::string_view name;

  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorKind::Asset, std::string(name) + ": " + reason);
  }
  /// Refuses sizes that are 0 or too large, before memory is taken.
  void check_size(std::uint64_t width, std::uint64_t height) const {
    if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide) return;
    refuse("the image has " + std::to_string(width) + " x " + std::to_string(height) +
           " pixels; 1 to " + std::to_string(kMaxSide) + " a side are read");
  }
};

Texture decode_png(const Source& source);
Texture decode_jpeg(const Source& source);
Texture decode_hdr(const Source& source);
Texture decode_exr(const Source& source);
Texture decode_bmp(const Source& source);
Texture decode_tga(const Source& source);

std::vector<std::byte> encode_png(const ImageView& image);
std::vector<std::byte> encode_jpeg(const ImageView& image);
std::vector<std::byte> encode_hdr(const ImageView& image);
std::vector<std::byte> encode_exr(const ImageView& image);

}  // namespace diorama::images
