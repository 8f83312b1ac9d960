// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/image.h"

namespace diorama {

/// The words that Replicator's image_output_format takes.
inline constexpr const char* kImageEndings[] = {"png", "jpeg", "jpg", "exr"};

/// Three bytes per pixel.
std::vector<std::uint8_t> without_alpha(const Image<Rgba8>& image);

std::vector<std::byte> png_file(const Host& host, const Image<Rgba8>& image);
/// Without alpha.
std::vector<std::byte> rgb_png_file(const Host& host, const Image<Rgba8>& image);
/// Eight bits of gray.
std::vector<std::byte> png_file(const Host& host, int width, int height,
                                std::span<const std::uint8_t> gray);
/// Eight bits of indices into a palette of up to 256 colours.
std::vector<std::byte> indexed_png_file(const Host& host, int width, int height,
                                        std::span<const std::uint8_t> indices,
                                        std::span<const std::array<std::uint8_t, 3>> palette);
/// Sixteen bits of gray. Throws Error(Output) that begins with `what` when a value is above 65535.
std::vector<std::byte> png_file(const Host& host, const Image<std::uint32_t>& image,
                                const std::string& what);
/// Without alpha, quality 75.
std::vector<std::byte> jpeg_file(const Host& host, const Image<Rgba8>& image);
/// Three 32-bit float channels.
std::vector<std::byte> exr_file(const Host& host, const Image<Vec3f>& image);

/// Replicator's picture of normals: trunc((n * 0.5 + 0.5) * 255); the fourth channel is 255 where
/// something was hit and 127 elsewhere.
Image<Rgba8> normals_picture(const Image<Vec3f>& normals);

/// Replicator's picture of distances: logarithmic from near (254) to far (0); infinity is 0, and so
/// is everything when the finite distances are all equal or not positive.
std::vector<std::uint8_t> distance_picture(const Image<float>& distances);

}  // namespace diorama
