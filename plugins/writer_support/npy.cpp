// SPDX-License-Identifier: Apache-2.0
#include "writer_support/npy.h"

#include <array>
#include <bit>
#include <string>

#include "diorama/error.h"

namespace diorama {

static_assert(std::endian::native == std::endian::little, "numbers are written as they are");

void PackedBytes::add_u8(std::uint8_t value) { bytes.push_back(std::byte(value)); }

void PackedBytes::add_u16(std::uint16_t value) {
  for (int shift = 0; shift < 16; shift += 8) bytes.push_back(std::byte((value >> shift) & 0xFF));
}

// All at once: point clouds are millions of these.
void PackedBytes::add_u32(std::uint32_t value) {
  std::array<std::byte, 4> four;
  for (std::size_t i = 0; i < four.size(); ++i) four[i] = std::byte((value >> (8 * i)) & 0xFF);
  bytes.insert(bytes.end(), four.begin(), four.end());
}

void PackedBytes::add_i32(std::int32_t value) { add_u32(std::bit_cast<std::uint32_t>(value)); }
void PackedBytes::add_f32(float value) { add_u32(std::bit_cast<std::uint32_t>(value)); }

std::vector<std::byte> npy_file(std::string_view descr, std::initializer_list<std::int64_t> shape,
                                std::span<const std::byte> data) {
  std::string header = "{'descr': " + std::string(descr) + ", 'fortran_order': False, 'shape': (";
  const char* separator = "";
  for (const std::int64_t extent : shape) {
    header += separator + std::to_string(extent);
    separator = ", ";
  }
  if (shape.size() == 1) header += ',';
  header += "), }";
  // Room for the first extent to grow to 21 digits, so that a file can be appended to in place.
  if (shape.size() > 0) header.append(21 - std::to_string(*shape.begin()).size(), ' ');
  constexpr std::size_t kPrefix = 10;
  while ((kPrefix + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  if (header.size() > 0xFFFF) throw Error(ErrorKind::Internal, "npy: header too long");

  PackedBytes file;
  file.bytes.reserve(kPrefix + header.size() + data.size());
  for (const unsigned char c : std::string_view("\x93NUMPY")) file.add_u8(c);
  file.add_u8(1);
  file.add_u8(0);
  file.add_u16(std::uint16_t(header.size()));
  for (const char c : header) file.add_u8(std::uint8_t(c));
  file.bytes.insert(file.bytes.end(), data.begin(), data.end());
  return std::move(file.bytes);
}

std::vector<std::byte> npy_file(const Image<float>& image) {
  return npy_file("'<f4'", {image.height(), image.width()}, std::as_bytes(image.pixels()));
}

}  // namespace diorama
