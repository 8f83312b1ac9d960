// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "crate_cursor.h"
#include "mapped_file.h"
#include "value.h"

namespace diorama::usd {

/// The tables of a crate file, and the values that refer to them.
class CrateValues : public ValueSource, public std::enable_shared_from_this<CrateValues> {
 public:
  /// One entry of the path table: an element below another path.
  struct PathEntry {
    static constexpr std::uint32_t kUnset = 0xFFFFFFFF;
    static constexpr std::uint32_t kRoot = 0xFFFFFFFE;
    std::uint32_t parent = kUnset;
    std::uint32_t token = 0;
    bool is_property = false;
  };

  CrateValues(std::string file, ByteView view) : file_(std::move(file)), view_(std::move(view)) {}

  Value decode(std::uint64_t representation) const override;
  bool may_hold_array(std::uint64_t representation) const override;

  const std::string& file() const { return file_; }
  CrateCursor cursor(std::uint64_t offset) const { return CrateCursor(file_, view_.bytes, offset); }
  bool at_least(int minor) const { return version_minor_ >= minor; }
  /// Throws when the index is out of range; so do the next two.
  std::string_view token(std::uint64_t index, std::uint64_t offset) const;
  std::string_view string(std::uint64_t index, std::uint64_t offset) const;
  /// Text of a path; empty for an entry that the file leaves out.
  std::string path(std::uint64_t index, std::uint64_t offset) const;

  int version_minor_ = 0;
  std::vector<std::byte> token_text_;
  std::vector<std::string_view> tokens_;
  std::vector<std::uint32_t> strings_;
  std::vector<PathEntry> paths_;

 private:
  class Decoder;

  std::string file_;
  ByteView view_;
};

}  // namespace diorama::usd
