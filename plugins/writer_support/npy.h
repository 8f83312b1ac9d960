// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/image.h"
#include "diorama/writer.h"

namespace diorama {

/// Collects numbers as little-endian bytes without padding.
class PackedBytes {
 public:
  void add_u8(std::uint8_t value);
  void add_u16(std::uint16_t value);
  void add_u32(std::uint32_t value);
  void add_i32(std::int32_t value);
  void add_f32(float value);

  std::vector<std::byte> bytes;
};

/// A NumPy .npy file, version 1.0, with the header padding of NumPy 1.24. `descr` is the dtype as
/// Python text: "'<f4'" or "[('a', '<u4'), ...]"; `data` has the elements in C order.
/// Format: numpy.org/doc/stable/reference/generated/numpy.lib.format.html
std::vector<std::byte> npy_file(std::string_view descr, std::initializer_list<std::int64_t> shape,
                                std::span<const std::byte> data);

/// Adds an image of any kind without a copy of its data: shape (height, width), with a third extent
/// where a pixel has several numbers. Colours are '|u1', ids '<u4', all else '<f4'.
void add_npy(DatasetFiles& files, const std::string& path, const AnyImage& image);

/// The numbers of an image as they lie in memory, and what a .npy file says of them.
struct ImageNumbers {
  std::string_view descr;
  std::vector<std::int64_t> shape;
  std::span<const std::byte> bytes;
};
ImageNumbers numbers_of(const AnyImage& image);
/// What stands before the data in a .npy file.
std::vector<std::byte> npy_header(std::string_view descr, std::span<const std::int64_t> shape);

}  // namespace diorama
