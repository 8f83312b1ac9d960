// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "diorama/frame.h"
#include "reader_support/npy_array.h"

namespace diorama {

/// The picture that an array of (height, width) or (height, width, numbers) is: bytes of four are
/// colours, 32-bit numbers ids, 32-bit floats all else, alone, in twos or in threes. Nothing for
/// other arrays.
std::optional<AnyImage> image_of_array(const StoredArray& array);

/// Makes an array a channel of the frame. Throws std::runtime_error when it is no picture, has
/// another size than the camera, or, as a channel of ours, another type.
void set_channel(Frame& frame, const std::string& name, const StoredArray& array);

/// Whole numbers of any width as ids. Throws std::runtime_error for other arrays, for ones that are
/// not (height, width) and for values that no id can have.
Image<std::uint32_t> ids_of_array(const StoredArray& array);

/// Floats of 32 or 64 bits, (height, width). Throws std::runtime_error for other arrays.
Image<float> floats_of_array(const StoredArray& array);

/// Three bytes (or four, the last without a meaning) per pixel. Throws std::runtime_error for other
/// arrays.
Image<Rgba8> color_of_array(const StoredArray& array);

/// "uint16 of 48 x 64": for messages.
std::string array_text(const StoredArray& array);

}  // namespace diorama
