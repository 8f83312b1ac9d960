// SPDX-License-Identifier: Apache-2.0
#include "error.h"

namespace diorama::usd {

FormatError format_error_at(const std::string& file, const std::string& what,
                            std::uint64_t offset) {
  return FormatError(file + ": " + what + " at byte offset " + std::to_string(offset));
}

FormatError format_error_at(const std::string& file, const std::string& what, std::size_t line,
                            std::size_t column) {
  return FormatError(file + ":" + std::to_string(line) + ":" + std::to_string(column) + ": " +
                     what);
}

}  // namespace diorama::usd
