// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace diorama::usd {

/// A layer or package that cannot be read. The text begins with the file and says what is wrong and
/// where: `room.usdc: 912 tokens do not fit into 40 bytes at byte offset 1208`.
class FormatError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// For binary files: `file: what at byte offset N`.
FormatError format_error_at(const std::string& file, const std::string& what, std::uint64_t offset);

/// For text files: `file:line:column: what`.
FormatError format_error_at(const std::string& file, const std::string& what, std::size_t line,
                            std::size_t column);

}  // namespace diorama::usd
