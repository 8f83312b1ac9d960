// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"

namespace diorama {

/// See Host::decode_texture. The format is told by the first bytes, not by the name (TGA, which has
/// no mark, by its name). Images beyond 16384 pixels a side are refused.
std::shared_ptr<const Texture> decode_image(std::span<const std::byte> bytes,
                                            std::string_view name);

/// See Host::encode_image. Throws Error(Internal) for sizes and pixel types that the format cannot
/// hold.
std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format);

}  // namespace diorama
