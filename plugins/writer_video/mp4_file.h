// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace diorama {

/// An MP4 file (ISO 14496-12) of one H.264 track whose pictures all stand alone: a front, the data
/// of the pictures in a row, and an index of them.
struct Mp4Track {
  int width = 0;
  int height = 0;
  double fps = 30.0;
  std::vector<std::byte> config;     ///< Box avcC.
  std::vector<std::uint32_t> sizes;  ///< Of the data of each picture, bytes.
};

std::vector<std::byte> mp4_front(const Mp4Track& track);
std::vector<std::byte> mp4_index(const Mp4Track& track);

}  // namespace diorama
