// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// A picture as MP4 files hold it.
struct H264Picture {
  std::vector<std::byte> data;    ///< Units with their lengths in front.
  std::vector<std::byte> config;  ///< Box avcC: the same for all pictures of one size and quality.
};

/// Encodes one picture that needs no other one, so that any thread may make any of a video's.
/// Width and height are even. `crf` is x264's: 0 without loss, 18 hardly to be told, 51 worst.
/// Neighbours in a video differ in `is_odd`. Throws Error(Plugin) when the library has no encoder
/// for H.264, or it fails.
H264Picture encode_h264(const Image<Rgba8>& picture, int crf, bool is_odd);

}  // namespace diorama
