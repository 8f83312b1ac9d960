// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"

namespace diorama {

/// Memory that decoding one picture may take unless the command line says another number. Enough
/// for a sky of 16384 x 8192 pixels of floats, and for 16384 x 16384 bytes with alpha.
inline constexpr std::uint64_t kPictureBudget = std::uint64_t(2) << 30;

/// See Host::decode_texture. The format is told by the first bytes, not by the name (TGA, which has
/// no mark, by its name). Refused before memory is taken: images beyond 16384 pixels a side, sizes
/// that the file is too short for, and what takes more than `budget` bytes to decode.
std::shared_ptr<const Texture> decode_image(std::span<const std::byte> bytes, std::string_view name,
                                            std::uint64_t budget = kPictureBudget);

/// See Host::encode_image. Throws Error(Internal) for sizes and pixel types that the format cannot
/// hold.
std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format);

}  // namespace diorama
