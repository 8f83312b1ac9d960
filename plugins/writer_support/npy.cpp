// SPDX-License-Identifier: Apache-2.0
#include "writer_support/npy.h"

#include <array>
#include <bit>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

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

std::vector<std::byte> npy_header(std::string_view descr, std::span<const std::int64_t> shape) {
  std::string header = "{'descr': " + std::string(descr) + ", 'fortran_order': False, 'shape': (";
  const char* separator = "";
  for (const std::int64_t extent : shape) {
    header += separator + std::to_string(extent);
    separator = ", ";
  }
  if (shape.size() == 1) header += ',';
  header += "), }";
  // Room for the first extent to grow to 21 digits, so that a file can be appended to in place.
  if (!shape.empty()) header.append(21 - std::to_string(shape[0]).size(), ' ');
  constexpr std::size_t kPrefix = 10;
  while ((kPrefix + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  if (header.size() > 0xFFFF) throw Error(ErrorKind::Internal, "npy: header too long");

  PackedBytes file;
  file.bytes.reserve(kPrefix + header.size());
  for (const unsigned char c : std::string_view("\x93NUMPY")) file.add_u8(c);
  file.add_u8(1);
  file.add_u8(0);
  file.add_u16(std::uint16_t(header.size()));
  for (const char c : header) file.add_u8(std::uint8_t(c));
  return std::move(file.bytes);
}

std::vector<std::byte> npy_file(std::string_view descr, std::initializer_list<std::int64_t> shape,
                                std::span<const std::byte> data) {
  std::vector<std::byte> file = npy_header(descr, std::span(shape.begin(), shape.size()));
  file.insert(file.end(), data.begin(), data.end());
  return file;
}

ImageNumbers numbers_of(const AnyImage& any) {
  return std::visit(
      []<class Pixel>(const Image<Pixel>& image) {
        constexpr bool kIsColor = std::is_same_v<Pixel, Rgba8>;
        constexpr bool kIsId = std::is_same_v<Pixel, std::uint32_t>;
        constexpr std::size_t kNumbers = sizeof(Pixel) / (kIsColor ? 1 : 4);
        ImageNumbers numbers{kIsColor ? "'|u1'"
                             : kIsId  ? "'<u4'"
                                      : "'<f4'",
                             {image.height(), image.width()},
                             std::as_bytes(image.pixels())};
        if (kNumbers > 1) numbers.shape.push_back(std::int64_t(kNumbers));
        return numbers;
      },
      any);
}

void add_npy(DatasetFiles& files, const std::string& path, const AnyImage& image) {
  const ImageNumbers numbers = numbers_of(image);
  files.append(path, npy_header(numbers.descr, numbers.shape));
  files.append(path, numbers.bytes);
}

}  // namespace diorama
