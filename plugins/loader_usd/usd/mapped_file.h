// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace diorama::usd {

/// Bytes that stay valid as long as `owner` is held: a mapped file, a part of it, or a buffer.
struct ByteView {
  std::shared_ptr<const void> owner;
  std::span<const std::byte> bytes;

  ByteView part(std::size_t offset, std::size_t size) const {
    return {owner, bytes.subspan(offset, size)};
  }
};

/// Maps a file for reading. Throws FormatError when it cannot be opened or is not a regular file.
ByteView map_file(const std::string& path);

/// Gives back the memory that reading a mapped file took; what is read again is fetched again. Only
/// for whole views of map_file().
void release_pages(const ByteView& file);

/// Owns a copy of `bytes`.
ByteView copy_bytes(std::span<const std::byte> bytes);

}  // namespace diorama::usd
