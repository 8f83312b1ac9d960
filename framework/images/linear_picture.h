// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "diorama/image.h"

namespace diorama {

/// Reads a picture in linear light (.exr, .hdr), without its alpha. Throws Error(Asset) when the
/// file cannot be read, has another size, or holds something else.
Image<Vec3f> read_linear_picture(const std::filesystem::path& file, int width, int height,
                                 const Host& host);

}  // namespace diorama
