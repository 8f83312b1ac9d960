// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/tar_archive.h"

#include <array>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "writer_webdataset/tar_walk.h"

namespace diorama {
namespace {

/// Places of the header's fields (IEEE Std 1003.1, pax, "ustar Interchange Format").
std::array<char, kTarBlock> make_header(std::string_view name, std::size_t size) {
  std::array<char, kTarBlock> header{};
  const auto octal = [&header](std::size_t at, int digits, std::size_t value) {
    std::snprintf(&header[at], std::size_t(digits) + 1, "%0*zo", digits, value);
  };
  std::memcpy(&header[0], name.data(), name.size());
  octal(100, 7, 0644);
  octal(108, 7, 0);
  octal(116, 7, 0);
  octal(124, 11, size);
  octal(136, 11, 0);
  std::memset(&header[148], ' ', 8);  // the checksum counts as spaces
  header[156] = '0';
  std::memcpy(&header[257], "ustar\00000", 8);
  std::size_t sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  octal(148, 6, sum);
  return header;
}

}  // namespace

void TarArchive::add(std::string_view name, std::span<const std::span<const std::byte>> parts) {
  std::size_t size = 0;
  for (const auto part : parts) size += part.size();
  if (name.empty() || name.size() > 100 || size >= (std::size_t(1) << 33)) {
    throw Error(ErrorKind::Output, "tar: cannot hold '" + std::string(name) + "' with " +
                                       std::to_string(size) + " bytes");
  }
  const auto header = make_header(name, size);
  put(std::as_bytes(std::span(header)));
  for (const auto part : parts) put(part);
  put(std::vector<std::byte>((kTarBlock - size % kTarBlock) % kTarBlock));
}

void TarArchive::add(std::string_view name, std::span<const std::byte> content) {
  add(name, std::span(&content, 1));
}

void TarArchive::add(std::string_view name, std::string_view content) {
  add(name, std::as_bytes(std::span(content.data(), content.size())));
}

void TarArchive::end() { put(std::vector<std::byte>(2 * kTarBlock)); }

void TarArchive::put(std::span<const std::byte> bytes) {
  out_(bytes);
  bytes_ += bytes.size();
}

}  // namespace diorama
