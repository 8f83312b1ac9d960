// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "error.h"

namespace diorama::usd {

/// Reads little-endian numbers from a crate file and never outside of it: every failure is a
/// FormatError that names the file and the byte offset.
class CrateCursor {
 public:
  CrateCursor(const std::string& file, std::span<const std::byte> bytes, std::uint64_t position)
      : file_(&file), bytes_(bytes), position_(position) {
    if (position > bytes.size()) fail("an offset points behind the end of the file");
  }

  std::uint64_t position() const { return position_; }
  std::uint64_t remaining() const { return bytes_.size() - position_; }

  template <class T>
  T read(const char* what) {
    T value;
    std::memcpy(&value, take(sizeof(T), what).data(), sizeof(T));
    return value;
  }

  /// The next `size` bytes.
  std::span<const std::byte> take(std::uint64_t size, const char* what) {
    if (size > remaining()) {
      fail(std::string(what) + " needs " + std::to_string(size) + " bytes but only " +
           std::to_string(remaining()) + " are left");
    }
    const auto part = bytes_.subspan(position_, size);
    position_ += size;
    return part;
  }

  /// A u64 count of items that take at least `item_size` bytes each in what is left of the file.
  std::uint64_t read_count(std::uint64_t item_size, const char* what);

  /// A cursor at `offset` relative to the current position.
  CrateCursor relative(std::int64_t offset) const;

  /// Decodes a compressed block of `compressed_size` bytes at the cursor to at most `limit` bytes.
  /// Takes memory for what the block decodes to, whatever `limit` claims.
  std::vector<std::byte> read_compressed(std::uint64_t compressed_size, std::uint64_t limit,
                                         const char* what);

  /// A size-prefixed list of `count` coded integers. Integer is (u)int32 or (u)int64.
  template <class Integer>
  std::vector<Integer> read_integers(std::uint64_t count, const char* what);

  [[noreturn]] void fail(const std::string& what) const { fail_at(what, position_); }
  [[noreturn]] void fail_at(const std::string& what, std::uint64_t offset) const {
    throw format_error_at(*file_, what, offset);
  }

 private:
  const std::string* file_;
  std::span<const std::byte> bytes_;
  std::uint64_t position_;
};

}  // namespace diorama::usd
